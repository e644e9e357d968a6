import re
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.hdl.flow.tools import have_yosys
from cubestack.host.devices.registry import emulated_names
from cubestack.host.pytest_plugin import KEYS
from tests.conftest import Outcome, Run
from tests.forked import forked, of_pytest

PLUGIN = "cubestack.host.pytest_plugin"

# An installation older than the entry point needs the plugin by name.
INSTALLED = any(entry.value == PLUGIN for entry in entry_points(group="pytest11"))
NAMED = () if INSTALLED else ("-p", PLUGIN)
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Runs pytest on the text of a test file."""

    def run(text: str, *options: str) -> Outcome:
        (tmp_path / "test_it.py").write_text("import pytest\n" + text)
        words = ("-q", "--strict-markers", *NAMED, *options)
        return forked(of_pytest(*words), folder=tmp_path)

    return run


def test_failed_test_reports_the_fault_log(run: Run, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('seed = 2\n[[fault]]\nkind = "latch-up"\n')
    done = run(
        "pytestmark = pytest.mark.cubestack(seed=3)\n"
        "@pytest.mark.cubestack(faults='plan.toml')\n"
        "def test_it(cubestar):\n"
        "    cubestar.wait(0.01)\n"
        "    assert (cubestar.seed, cubestar.faults.seed) == (0, 0)\n"
        "def test_profile(cubestar, aramis):\n"
        f"    assert cubestar.chosen == aramis.chosen == {{'profile': '{DEFAULT_PROFILE}'}}\n",
        "--junitxml=report.xml",
    )
    assert done.code == 1
    assert "1 failed, 1 passed" in done.out
    assert "assert (3, 2) == (0, 0)" in done.out
    assert "virtual time 0.010000000 s, seed 3\n0.000000000 s latch-up memory: 300" in done.out
    report = (tmp_path / "report.xml").read_text()
    assert 'name="cubestack.cubestar.virtual_time_s" value="0.010000000"' in report
    assert 'name="cubestack.cubestar.fault_events" value="1"' in report


TAKES = (
    f"marker cubestack takes {', '.join(KEYS)}, layout, firmware, firmware_base, semihosting, "
    "semihosting_root, serial, gateware, gateware_param, profile, set"
)
WRONG_MARKERS = {
    "(3)": TAKES,
    "(sead=3)": TAKES,
    "(faults='seed = -1')": "seed must be at least 0, not -1",
    "(layout='2')": "layout is an option of cubestar, not of aramis",
    "(profile='best')": "profile of aramis must be one of published, extended, not 'best'",
    "(faults='none.toml')": "none.toml: No such file or directory",
}


def test_seed_and_profile_come_from_marker_or_command_line(run: Run) -> None:
    """Invalid markers fail their tests only."""
    text = (
        "def test_it(cubestar, aramis):\n"
        "    assert cubestar.seed == 8\n"
        "    assert cubestar.chosen == aramis.chosen == {'profile': 'extended'}\n"
        "@pytest.mark.cubestack(profile='published', set='weights=grey-level')\n"
        "def test_own(aramis):\n"
        "    assert aramis.chosen == {'profile': 'published', 'set': 'weights=grey-level'}\n"
    ) + "".join(
        f"@pytest.mark.cubestack{marker}\ndef test_{number}(aramis): pass\n"
        for number, marker in enumerate(WRONG_MARKERS)
    )
    done = run(text, "--cubestack-seed=8", "--cubestack-profile=extended")
    assert done.code == 1
    assert f"2 passed, {len(WRONG_MARKERS)} errors" in done.out
    told = re.findall(r"^E  +(.*)", done.out, re.MULTILINE)
    for line, message in zip(told, WRONG_MARKERS.values(), strict=True):
        assert message in line


@pytest.mark.slow
@pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")
def test_fixture_runs_own_gateware(run: Run) -> None:
    file = Path(__file__).parents[2] / "examples/own_gateware/frame_buffer.v"
    done = run(
        f"@pytest.mark.cubestack(gateware={str(file)!r}, gateware_param='COLUMNS=1024')\n"
        "def test_it(cubestar):\n"
        "    assert cubestar.board.engine.wiring.foreign\n"
        "    assert cubestar.client.capture_and_process().name == 'CALCULATED'\n"
    )
    assert done.code == 0, done.out


def test_every_registered_device_has_a_fixture(run: Run) -> None:
    done = run("", "--fixtures", "-v")
    for name in emulated_names():
        assert f"\n{name} -- " in done.out


def test_plugin_imports_nothing_heavy(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(
        "import sys\n"
        "def test_it():\n"
        "    heavy = {'numpy', 'amaranth', 'simpy', 'cubestack.emulator'}\n"
        "    assert not heavy & set(sys.modules)\n"
    )
    plugins = (*NAMED, "-p", "no:hypothesispytest", "-p", "no:cacheprovider")
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", *plugins], cwd=tmp_path)
    assert done.returncode == 0


def test_entry_point_names_the_plugin() -> None:
    project = Path(__file__).parents[2] / "pyproject.toml"
    assert f'cubestack = "{PLUGIN}"' in project.read_text()


@pytest.mark.slow
def test_sleeping_driver_runs_in_virtual_time(run: Run, tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(
        "from time import monotonic, sleep\n"
        "def measure(port):\n"
        "    port.write(bytes([0x1F, 0x7F, 30, 3, 0x1F, 0xFF]))\n"
        "    began = monotonic()\n"
        "    while not port.in_waiting:\n"
        "        sleep(0.1)\n"
        "        if monotonic() - began > 600:\n"
        "            return None\n"
        "    return monotonic() - began\n"
    )
    test = "    assert driver.measure(cubestar.serial()) == pytest.approx(0.1, abs=0.001)\n"
    done = run(f"import driver, time\ndef test_it(cubestar):\n{test}    time.sleep(3000)\n")
    assert done.code == 0, done.out
    done = run(
        "import time\nSLEEP = time.sleep\n@pytest.mark.cubestack(wall_time=True)\n"
        "def test_it(cubestar):\n    assert time.sleep is SLEEP\n"
    )
    assert done.code == 0, done.out
