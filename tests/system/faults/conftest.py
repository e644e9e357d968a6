"""Devices to break, and the marker that says which faults a test shows.

``@pytest.mark.fault(KIND ...)`` stands on every test that shows what a fault does and what the
firmware makes of it; without kinds, it is that of the test's parameter ``kind``. Which device it is
says the fixture. A marked test whose faults did nothing fails.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene

from .bench import BENCHES, NADIR_DEG, Bench


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "fault(*kinds): the test shows what these faults do")


def _powered(
    request: pytest.FixtureRequest, power_up: Callable[[], AbstractContextManager[Bench]]
) -> Iterator[Bench]:
    marker = request.node.get_closest_marker("fault")
    with power_up() as bench:
        yield bench
        if marker is not None:
            kinds = marker.args or [request.node.callspec.params["kind"]]
            assert set(kinds) <= {event.kind for event in bench.faults.log}


@pytest.fixture
def star(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """A CubeStar."""
    yield from _powered(request, BENCHES["cubestar"])


@pytest.fixture
def sense(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """A CubeSense."""
    yield from _powered(request, BENCHES["cubesense"])


@pytest.fixture
def tracker(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """An AraMiS star tracker."""
    yield from _powered(request, BENCHES["aramis"])


@pytest.fixture(params=BENCHES)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Each of the devices."""
    yield from _powered(request, BENCHES[request.param])


@pytest.fixture
def quiet(sense: Bench) -> Bench:
    """A sensor without noise, so that all pictures of the nadir camera are the same."""
    still = EarthSunScene.facing(nadir_deg=NADIR_DEG)
    sense.board.scene = EarthSunView(still, FisheyeCondition(noise=False))
    from .cubesense_bench import check_right, measure

    check_right(measure(sense))
    return sense


@pytest.fixture(scope="session")
def good() -> np.ndarray:
    """CubeStar's picture without faults, (512, 1024)."""
    from .cubestar_bench import stored

    with BENCHES["cubestar"]() as bench:
        bench.device.capture_and_process()
        return stored(bench)
