"""What the tests of a whole AraMiS star tracker share."""

import pytest

from cubestack.emulator.boards.aramis.catalogue import onboard_database


@pytest.fixture(scope="session", autouse=True)
def _compiler() -> None:
    """No FPGA, so no compiler is wanted; but the catalogue, which is compiled and kept here."""
    onboard_database()


@pytest.fixture(scope="session")
def device_name() -> str:
    return "aramis"
