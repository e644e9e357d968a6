import runpy
import shutil
import subprocess
import sys
import time
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.host.emulation.emulated import open_device
from cubestack.host.experiments.attitude import errors
from tests.conftest import Outcome
from tests.forked import forked
from tests.system.conftest import ROOT, compile_c

HERE = ROOT / "examples"
PLUGIN = "cubestack.host.pytest_plugin"
TIMEOUT_S = 120


@pytest.fixture
def device() -> Any:
    with open_device("cubestar", seed=4) as device:
        yield device


@pytest.fixture(scope="session")
def flight_driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_c(HERE / "flight_driver.c", tmp_path_factory.mktemp("flight"))


def run(*command: str | Path, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=TIMEOUT_S)


def script(path: Path, *words: object) -> Outcome:
    """Runs a program in Python, with words, in a fork of this process."""

    def main() -> None:
        sys.argv = [str(path), *map(str, words)]
        runpy.run_path(str(path), run_name="__main__")

    return forked(main)


def check_attitude(device: Any, output: str) -> None:
    """The printed attitude is that of the camera."""
    quaternion = np.array([float(word) for word in output.split()])
    cross, roll = errors(quaternion / np.linalg.norm(quaternion), device.board.truth())
    assert cross < 0.02  # telemetry counts in steps of 1e-4
    assert abs(roll) < 0.05


def test_flight_driver_prints_the_attitude(device: Any, flight_driver: Path) -> None:
    done = device.run(flight_driver, "{port}")
    assert (done.returncode, done.stderr) == (0, "")
    check_attitude(device, done.stdout)


def test_flight_driver_survives_a_corrupted_line(device: Any, flight_driver: Path) -> None:
    device.faults.inject("uart-corrupt", direction="to-host", at_s=0.3, for_s=0.3)
    done = device.run(flight_driver, "{port}", pace="real")
    assert done.returncode == 0, done.stderr
    assert device.faults.events > 0
    check_attitude(device, done.stdout)


def test_flight_driver_reports_a_dead_camera(device: Any, flight_driver: Path) -> None:
    device.faults.inject("camera-dead")
    done = device.run(flight_driver, "{port}")
    assert done.returncode == 1
    assert done.stderr == "flight_driver: no attitude in this picture\n"


def test_flight_driver_reports_a_missing_port(flight_driver: Path) -> None:
    done = run(flight_driver, "/nowhere")
    assert (done.returncode, done.stderr) == (1, "flight_driver: No such file or directory\n")


def test_smbus2_example_prints_the_attitude(device: Any) -> None:
    done = device.run_on_i2c(sys.executable, HERE / "smbus2_attitude.py", "7")
    assert done.returncode == 0
    check_attitude(device, done.stdout)


def test_bringup_example_passes_all_six_steps(device: Any) -> None:
    done = device.run(sys.executable, HERE / "bringup.py", "{port}")
    assert done.returncode == 0, done.stdout + done.stderr
    assert [line.split()[1] for line in done.stdout.splitlines()] == ["ok"] * 6


def test_bringup_names_the_step_that_fails(device: Any) -> None:
    device.faults.inject("blooming", threshold=20, length=400)
    done = device.run(sys.executable, HERE / "bringup.py", "{port}")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith("5 FAIL")


@pytest.mark.slow
def test_driver_suite_passes(tmp_path: Path) -> None:
    suite = tmp_path / "test_my_driver.py"
    shutil.copy(HERE / suite.name, suite)
    report = tmp_path / "report.xml"
    # An installation older than the entry point needs the plugin by name.
    installed = any(entry.value == PLUGIN for entry in entry_points(group="pytest11"))
    plugin = [] if installed else ["-p", PLUGIN]
    command = (sys.executable, "-m", "pytest", *plugin, "-q", f"--junitxml={report}", suite)
    done = run(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    assert "5 passed" in done.stdout
    assert 'name="cubestack.cubestar.fault_events"' in report.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name",
    [
        *("bringup.py", "plain_pyserial.py", "smbus2_attitude.py"),
        *("slew_animation.py", "one_orbit.py"),
    ],
)
def test_missing_target_prints_usage(name: str) -> None:
    done = script(HERE / name)
    assert done.code == 1
    assert done.line.startswith(f"usage: python {name} ")


@pytest.fixture(scope="module")
def attitude_loop() -> Any:
    return SimpleNamespace(**runpy.run_path(str(HERE / "attitude_loop.py")))


@pytest.mark.slow
def test_attitude_loop_is_the_same_in_every_run(attitude_loop: Any) -> None:
    first, second = ([*attitude_loop.loop(faults=True, until_s=8.0)] for _ in range(2))
    assert repr(first) == repr(second)
    assert [row.star is None for row in first] == [True, False, False, False, False]
    assert [row.earth is None for row in first] == [True, True, True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensors", "largest_deg"), [(("star-tracker",), 0.01), (("sun-earth",), 0.5)]
)
def test_attitude_loop_settles(
    attitude_loop: Any, sensors: tuple[str, ...], largest_deg: float
) -> None:
    began_s = time.process_time()
    rows = [*attitude_loop.loop(sensors)]
    assert time.process_time() - began_s < rows[-1].time_s / 10  # ten times real time
    assert rows[0].error_deg > 3.0
    assert max(row.error_deg for row in rows if row.time_s >= 120) < largest_deg


@pytest.mark.slow
def test_attitude_loop_recovers_from_latch_up_and_moon(attitude_loop: Any) -> None:
    rows = [*attitude_loop.loop(faults=True)]
    missing = [round(row.star.time_s) for row in rows if row.star and row.star.value is None]
    assert missing == [60, *range(120, 140, 2)]
    for row in rows:
        if row.star is not None and row.star.value is not None:
            assert row.time_s - 2.0 < row.star.time_s < row.time_s
    assert max(row.error_deg for row in rows if row.time_s >= 120) < 0.5
    assert max(row.error_deg for row in rows if row.time_s >= 170) < 0.01


@pytest.mark.slow
def test_one_orbit_writes_results_and_a_figure(tmp_path: Path) -> None:
    orbit = HERE / "orbits" / "sun-synchronous.toml"
    call = [sys.executable, HERE / "one_orbit.py", orbit, tmp_path, "8"]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    assert "star tracker, attitude: 6 of 6 found" in done.stdout
    rows = (tmp_path / "results.csv").read_text().splitlines()
    assert len(rows) == 7
    assert (tmp_path / "errors.png").stat().st_size > 10_000


def test_slew_animation_writes_a_gif(tmp_path: Path) -> None:
    path = tmp_path / "slew.gif"
    done = script(HERE / "slew_animation.py", path, 3)
    assert done.code == 0
    assert "3 frames, 3 of them with an attitude" in done.out
    with Image.open(path) as drawn:
        assert (drawn.n_frames, drawn.width) == (3, 640)
