"""pytest fixtures: one per registered device, by its name, for tests of a driver.

::

    def test_my_driver(sensor):
        driver = MyDriver(sensor.serial())
        sensor.faults.inject("uart-corrupt", rate=0.01)
        assert driver.attitude().valid

Marker ``cubestack(scene=…, seed=…, faults=…)`` sets a device up: ``scene`` and ``faults`` are
paths, or a scene object and the text of a plan. It also takes every option of the device's board,
e.g. ``profile="extended"``. ``time.sleep`` and the clocks of the code under test are virtual unless
``wall_time=True``. The JUnit report has seed, virtual time and number of fault events; a failed
test prints the fault events.
"""

from argparse import ArgumentTypeError
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import pytest

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE, PROFILES
from cubestack.host.devices.device import ENGINE_FORM, Engine, engine_name
from cubestack.host.devices.registry import devices, emulated_names
from cubestack.host.emulation.virtual_clock import VirtualClock
from cubestack.host.output import Outputs

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from cubestack.host.emulation.emulated import AnyEmulated

MARKER = "cubestack"
COVERAGE = "cubestack-coverage"
KEYS = ("scene", "seed", "faults", "wall_time")
LINES_SHOWN = 40

_DEVICES = pytest.StashKey[dict[str, Any]]()
_CLOCK = VirtualClock()


def _engine(text: str) -> str:
    try:
        return engine_name(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("cubestack", "emulated CubeSat camera sensors")
    group.addoption(
        "--cubestack-seed", type=int, default=0, metavar="N", help="seed of all emulated devices"
    )
    group.addoption(
        "--cubestack-profile",
        choices=PROFILES,
        help=f"for devices without a scene of their own (default {DEFAULT_PROFILE})",
    )
    group.addoption(
        "--cubestack-engine",
        type=_engine,
        default="auto",
        metavar=ENGINE_FORM,
        help="how to run the FPGA (default: compiled, if a compiler is installed)",
    )
    group.addoption(
        "--cubestack-wall-time",
        action="store_true",
        help="keep wall time in drivers (default: their sleeps and clocks are virtual)",
    )
    group.addoption(
        "--cubestack-coverage",
        type=Path,
        metavar="FILE",
        help="executed lines of own firmware in all tests, as an lcov file; a worker of "
        "pytest-xdist adds its name to FILE",
    )


class _Coverage:
    """Collects the coverage of the session's devices; the file is opened for the first of them."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stack = Outputs()
        self._watch: Callable[[AnyEmulated], None] | None = None

    def watch(self, opened: "AnyEmulated") -> None:
        from cubestack.host.emulation.records import InsightFiles

        if opened.board.insight is None:
            return
        if self._watch is None:
            self._watch = InsightFiles(coverage=self._path).open(self._stack)
        self._watch(opened)

    def pytest_unconfigure(self) -> None:
        """Write the file."""
        self._stack.close()


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker, and a fixture for each device."""
    config.addinivalue_line(
        "markers",
        f"{MARKER}({', '.join(KEYS)}, profile, ...): set up the emulated device of this test",
    )
    fixtures = ModuleType("cubestack_fixtures")
    for name in emulated_names():
        setattr(fixtures, name, _fixture(name))
    config.pluginmanager.register(fixtures, "cubestack-fixtures")
    path = config.getoption("--cubestack-coverage")
    if path is not None:
        worker = getattr(config, "workerinput", {}).get("workerid")
        config.pluginmanager.register(
            _Coverage(path.with_name(f"{path.name}.{worker}") if worker else path), COVERAGE
        )


def _fixture(name: str) -> Any:
    """The fixture of a device: powered up as the test's marker says, closed after the test."""

    def powered(request: pytest.FixtureRequest) -> "Iterator[AnyEmulated]":
        from cubestack.emulator.faults.plan import load_plan, parse_plan
        from cubestack.host.devices.registry import device
        from cubestack.host.emulation.emulated import open_device

        options = _options(request.node)
        config = request.config
        own, profile = device(name), config.getoption("--cubestack-profile")
        board = {one: value for one, value in options.items() if one not in KEYS}
        if profile is not None and own.switches.declared() and "firmware" not in board:
            board = {"profile": profile, **board}
        seed = options.get("seed", config.getoption("--cubestack-seed"))
        engine: Engine = config.getoption("--cubestack-engine") if own.has_fpga else "auto"
        with open_device(name, options.get("scene"), seed=seed, engine=engine, **board) as opened:
            coverage = config.pluginmanager.get_plugin(COVERAGE)
            if coverage is not None:
                coverage.watch(opened)
            plan = options.get("faults")
            if plan is not None:
                text = isinstance(plan, str) and ("\n" in plan or "=" in plan)
                opened.faults.load(parse_plan(plan) if text else load_plan(Path(plan)))
            request.node.stash.setdefault(_DEVICES, {})[name] = opened
            wall_time = options.get("wall_time", config.getoption("--cubestack-wall-time"))
            with nullcontext() if wall_time else _CLOCK.follow(opened):
                yield opened
            for key, value in (
                ("seed", seed),
                ("virtual_time_s", f"{opened.time_s:.9f}"),
                ("fault_events", opened.faults.events),
            ):
                request.node.user_properties.append((f"{MARKER}.{name}.{key}", value))

    powered.__doc__ = f"An emulated {name}; see ``cubestack.EmulatedDevice``."
    return pytest.fixture(powered, name=name)


def _options(item: pytest.Item) -> dict[str, Any]:
    options: dict[str, Any] = {}
    for marker in reversed(list(item.iter_markers(MARKER))):  # the closest marker wins
        owners = devices(emulated_names())
        known = dict.fromkeys((*KEYS, *(one.name for own in owners for one in own.all_options)))
        if marker.args or not set(marker.kwargs) <= set(known):
            raise pytest.UsageError(
                f"{item.nodeid}: marker {MARKER} takes {', '.join(known)} by name, nothing else"
            )
        options |= marker.kwargs
    return options


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> "Generator[None, pytest.TestReport, pytest.TestReport]":
    report = yield
    if call.when == "call" and report.failed:
        for name, device in item.stash.get(_DEVICES, {}).items():
            log = device.faults.log
            lines = [f"virtual time {device.time_s:.9f} s, seed {device.seed}"]
            lines += [str(event) for event in log[-LINES_SHOWN:]]
            if len(log) > LINES_SHOWN:
                lines.insert(1, f"the last {LINES_SHOWN} of {device.faults.events} fault events:")
            report.sections.append((f"emulated {name}", "\n".join(lines)))
    return report
