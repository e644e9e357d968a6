"""What the tests of a whole AraMiS star tracker share."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cubestack.host.cli.aramis_session import aramis_catalogue
from cubestack.host.cli.main import main

Frames = list[dict[str, Any]]

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session", autouse=True)
def _compiler() -> None:
    """No FPGA, so no compiler is wanted; but the catalogue, which is compiled and kept here."""
    aramis_catalogue()


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def measure(capsys: pytest.CaptureFixture[str]) -> Callable[..., Frames]:
    """`cubestack measure aramis --json` with more arguments; the results that it prints."""

    def run(*arguments: object) -> Frames:
        capsys.readouterr()
        code = main(["measure", "aramis", "--json", *map(str, arguments)])
        output = capsys.readouterr()
        assert (code, output.err) == (0, "")
        return [json.loads(line) for line in output.out.splitlines()]

    return run
