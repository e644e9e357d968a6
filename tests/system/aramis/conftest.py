"""What the tests of a whole AraMiS star tracker share."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.boards.aramis.catalogue import onboard_database

Frames = list[dict[str, Any]]

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session", autouse=True)
def _compiler() -> None:
    """No FPGA, so no compiler is wanted; but the catalogue, which is compiled and kept here."""
    onboard_database()


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def measure(measure_device: Callable[..., Frames]) -> Callable[..., Frames]:
    """`cubestack measure aramis --json` with more arguments; the results that it prints."""
    return partial(measure_device, "aramis")
