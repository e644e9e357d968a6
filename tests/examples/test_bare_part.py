"""examples/bare_part: its tests pass, and each fails when the firmware is broken."""

import os
import shutil
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from tests.emulator.boards.efm32gg.programs import EXAMPLE, needs_both_compilers

pytestmark = [*needs_both_compilers, pytest.mark.slow]

PLUGIN = "cubestack.host.pytest_plugin"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    built = shutil.ignore_patterns("*.elf", "processor.h", "__pycache__")
    return Path(shutil.copytree(EXAMPLE, tmp_path / "project", ignore=built))


def passed(project: Path, *words: str) -> str:
    """The last lines of make and pytest."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    installed = any(entry.value == PLUGIN for entry in entry_points(group="pytest11"))
    plugin = [] if installed else ["-p", PLUGIN]
    calls = (
        ["make", "-s"],
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *plugin, *words],
    )
    for call in calls:
        done = subprocess.run(
            call, cwd=project, env=os.environ | {"PATH": path}, capture_output=True, text=True
        )
    return done.stdout


def test_passes_and_covers_the_application(project: Path) -> None:
    assert "5 passed" in passed(project, "--cubestack-coverage", "cov.info")
    records = (project / "cov.info").read_text().split("end_of_record\n")
    found = {Path(one.split("SF:")[1].split("\n")[0]).name: one for one in records if one}
    assert set(found) == {"debounce.c", "main.c", "start.c", "unit_tests.c"}
    assert "LF:8\nLH:8\n" in found["debounce.c"]
    assert "FNDA:0,fault_handler" in found["start.c"]


@pytest.mark.parametrize(
    ("file", "right", "wrong", "failures"),
    [
        ("debounce.h", "STABLE_MS 5u", "STABLE_MS 1u", 2),  # bounces: on the target and outside
        ("main.c", "#define LED 2", "#define LED 3", 2),
        ("main.c", "UART_LOCATION 1u", "UART_LOCATION 0u", 3),
    ],
)
def test_detects_a_broken_firmware(
    project: Path, file: str, right: str, wrong: str, failures: int
) -> None:
    source = project / file
    assert right in source.read_text()
    source.write_text(source.read_text().replace(right, wrong))
    assert f"{failures} failed" in passed(project)
