"""pytest fixtures ``cubestar`` and ``cubesense``: an emulated device for the tests of a driver.

::

    def test_my_driver(cubestar):
        driver = MyDriver(cubestar.serial())
        cubestar.faults.inject("uart-corrupt", rate=0.01)
        assert driver.attitude().valid

Marker ``cubestack(scene=…, seed=…, faults=…)`` sets a device up: ``scene`` and ``faults`` are
paths, or a scene of the emulator and the text of a plan. Seed, virtual time and number of fault
events go into the JUnit report; what the faults did is shown below a test that failed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from cubestack.host.clients.cubesense.client import CubeSense
    from cubestack.host.clients.cubestar.client import CubeStar
    from cubestack.host.devices.emulated import EmulatedDevice

__all__ = ["cubesense", "cubestar"]

MARKER = "cubestack"
KEYS = ("scene", "seed", "faults")
LINES_SHOWN = 40

_DEVICES = pytest.StashKey[dict[str, Any]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("cubestack", "emulated CubeSat camera sensors")
    group.addoption(
        "--cubestack-seed", type=int, default=0, metavar="N", help="seed of all emulated devices"
    )
    group.addoption(
        "--cubestack-engine",
        choices=("auto", "compiled", "python"),
        default="auto",
        help="how the FPGA is run (default: compiled where there is a compiler)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker."""
    config.addinivalue_line(
        "markers", f"{MARKER}(scene, seed, faults): set up the emulated device of this test"
    )


@pytest.fixture
def cubestar(request: pytest.FixtureRequest) -> Iterator[EmulatedDevice[CubeStar]]:
    """An emulated CubeStar; see ``EmulatedDevice``."""
    from cubestack.host.devices.emulated import open_cubestar_device

    yield from _powered(request, "cubestar", open_cubestar_device)


@pytest.fixture
def cubesense(request: pytest.FixtureRequest) -> Iterator[EmulatedDevice[CubeSense]]:
    """An emulated CubeSense; see ``EmulatedDevice``."""
    from cubestack.host.devices.emulated import open_cubesense_device

    yield from _powered(request, "cubesense", open_cubesense_device)


def _powered(
    request: pytest.FixtureRequest, name: str, open_device: Callable[..., Any]
) -> Iterator[Any]:
    """Power a device up as the test's marker says, and down after it."""
    from cubestack.emulator.faults.plan import load_plan, parse_plan

    options = _options(request.node)
    config = request.config
    seed = options.get("seed", config.getoption("--cubestack-seed"))
    engine = config.getoption("--cubestack-engine")
    device = open_device(options.get("scene"), seed=seed, engine=engine)
    try:
        plan = options.get("faults")
        if plan is not None:
            text = isinstance(plan, str) and ("\n" in plan or "=" in plan)
            device.faults.load(parse_plan(plan) if text else load_plan(Path(plan)))
        request.node.stash.setdefault(_DEVICES, {})[name] = device
        yield device
        for key, value in (
            ("seed", seed),
            ("virtual_time_s", f"{device.time_s:.9f}"),
            ("fault_events", device.faults.events),
        ):
            request.node.user_properties.append((f"{MARKER}.{name}.{key}", value))
    finally:
        device.close()


def _options(item: pytest.Item) -> dict[str, Any]:
    options: dict[str, Any] = {}
    for marker in reversed(list(item.iter_markers(MARKER))):  # the closest one has the last word
        if marker.args or not set(marker.kwargs) <= set(KEYS):
            raise pytest.UsageError(
                f"{item.nodeid}: marker {MARKER} takes {', '.join(KEYS)} by name, nothing else"
            )
        options |= marker.kwargs
    return options


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Show what the faults did below a test that failed."""
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
