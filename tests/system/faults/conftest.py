"""Devices for the fault tests, and the marker ``fault``.

``@pytest.mark.fault(KIND ...)`` marks every test of the effects of a fault; without kinds, the
test's parameter ``kind`` is used. The fixture determines the device. A marked test fails if its
faults had no effect.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import EarthSunScene
from tests.system.cubesense.conftest import NADIR_DEG

from .bench import BENCHES, Sense, powered


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "fault(*kinds): the test shows what these faults do")


def one_of(*names: str) -> Any:

    @pytest.fixture(params=names)
    def powered_up(request: pytest.FixtureRequest, profile: str) -> Iterator[Any]:
        marker = request.node.get_closest_marker("fault")
        with powered(request.param, profile) as bench:
            yield bench
            if marker is not None:
                kinds = marker.args or [request.node.callspec.params["kind"]]
                assert set(kinds) <= {event.kind for event in bench.faults.log}

    return powered_up


star, sense, tracker = one_of("cubestar"), one_of("cubesense"), one_of("aramis")
bench = one_of(*BENCHES)


@pytest.fixture
def quiet(sense: Sense) -> Sense:
    """A sensor without noise, so that all pictures of the nadir camera are the same."""
    still = EarthSunScene.facing(nadir_deg=NADIR_DEG)
    sense.board.scene = EarthSunView(still, FisheyeCondition(noise=False))
    sense.check()
    return sense


@pytest.fixture(scope="session")
def good() -> np.ndarray:
    """CubeStar's picture without faults, (512, 1024)."""
    with powered("cubestar") as star:
        star.device.capture_and_process()
        found: np.ndarray = star.stored
        return found
