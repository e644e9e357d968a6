"""`cubestack.basilisk` inside of Basilisk itself; skipped where it is not installed."""

import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.host.errors import install_command

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def closed_loop() -> Any:
    pytest.importorskip("Basilisk")
    if find_compiler() is None:
        pytest.skip("no C++ compiler")
    sys.path.append(str(ROOT / "examples" / "basilisk"))
    import closed_loop

    return closed_loop


def test_missing_basilisk_is_one_line() -> None:
    code = "import sys; sys.modules['Basilisk'] = None; import cubestack.basilisk"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    error = done.stderr.splitlines()[-1]
    command = install_command("basilisk")
    assert error == f"ImportError: cubestack.basilisk needs Basilisk: {command}".rstrip()


def test_attitudes_equal_those_of_basilisk(closed_loop: Any) -> None:
    from Basilisk.utilities import RigidBodyKinematics as Kinematics

    from cubestack.basilisk.frames import euler_parameters, matrix_from_mrp

    rng = np.random.default_rng(3)
    for _ in range(20):
        sigma, quaternion = rng.uniform(-1, 1, 3), random_quaternion(rng)
        assert matrix_from_mrp(sigma) == pytest.approx(Kinematics.MRP2C(sigma))
        theirs = Kinematics.EP2C(euler_parameters(quaternion))
        assert theirs == pytest.approx(matrix_from_quaternion(quaternion))


def test_module_needs_the_state(closed_loop: Any) -> None:
    import cubestack

    with cubestack.open_device("cubestar") as device:
        tracker = closed_loop.StarTracker(device)
        with pytest.raises(ValueError, match="cubestar: scStateInMsg is not connected"):
            tracker.Reset(0)


def run(closed_loop: Any, sensors: tuple[str, ...], faults: bool, until_s: float) -> Any:
    with ExitStack() as stack:
        scenario = closed_loop.Scenario(stack, sensors, faults, 0)
        scenario.run(until_s)
        return scenario


def test_messages_are_the_same_in_every_run(closed_loop: Any) -> None:
    both = closed_loop.plain.BOTH
    first, second = (run(closed_loop, both, True, 8.0).rows() for _ in range(2))
    assert repr(first) == repr(second)
    assert first[-1][2] == pytest.approx(6.24, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensors", "largest_deg"), [(("star-tracker",), 0.01), (("sun-earth",), 0.5)]
)
def test_loop_settles(closed_loop: Any, sensors: tuple[str, ...], largest_deg: float) -> None:
    errors_deg = run(closed_loop, sensors, False, 200.0).errors_deg()
    assert errors_deg[0] > 3.0
    assert max(errors_deg[60:]) < largest_deg


@pytest.mark.slow
def test_messages_show_latch_up_and_moon(closed_loop: Any, tmp_path: Path) -> None:
    scenario = run(closed_loop, closed_loop.plain.BOTH, True, 200.0)
    tags, fixes = np.array(scenario.star.timeTag) / 1e9, np.any(scenario.star.qInrtl2Case, axis=1)
    missing = sorted({round(tag) for tag in tags[~fixes]})
    assert missing == [0, 60, *range(120, 140, 2)]
    first = 8 // 2  # rows before the first measurement is over
    assert np.any(scenario.sun.vehSunPntBdy, axis=1)[first:].all()
    errors_deg = scenario.errors_deg()
    assert max(errors_deg[60:]) < 0.5
    assert max(errors_deg[85:]) < 0.01
    closed_loop.write(scenario, tmp_path)
    assert (tmp_path / "loop.png").stat().st_size > 5_000
    assert len((tmp_path / "messages.csv").read_text().splitlines()) == 102
