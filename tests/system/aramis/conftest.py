import pytest

from cubestack.emulator.boards.aramis.catalogue import onboard_database


@pytest.fixture(scope="session", autouse=True)
def _compiler() -> None:
    """Needs no FPGA, only the catalogue, which is compiled and cached."""
    onboard_database()


@pytest.fixture(scope="session")
def device_name() -> str:
    return "aramis"
