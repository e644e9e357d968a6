from functools import partial
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES, CubeSenseBoard
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, ROWS, Camera
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from tests.system.conftest import Open

SUN_DEG = (20.0, 10.0)
NADIR_DEG = (-8.0, 12.0)
TRUTH_DEG = {Camera.SUN: SUN_DEG, Camera.NADIR: NADIR_DEG}

#: Sun and Earth in view of their cameras.
FACING = EarthSunScene.facing(sun_deg=SUN_DEG, nadir_deg=NADIR_DEG)


@pytest.fixture(scope="session")
def device_name() -> str:
    return "cubesense"


@pytest.fixture
def session(device_name: str, profile: str) -> Open:
    """Opens the device with the lenses of the firmware's tables."""
    return partial(open_device, device_name, profile=profile, set="lens=nominal")


@pytest.fixture
def ready(session: Open) -> Open:
    """Opens the device with a scene and waits until its cameras are set up."""

    def start(scene: Any = FACING, **options: Any) -> AnyEmulated:
        opened = session(scene, **options)
        opened.client.client.pause(0.3)
        return opened

    return start


def check_right(found: Measurement, expected: tuple[float, float] | None = None) -> None:
    """The direction is the expected one, or the truth's."""
    assert found.detected
    expected = expected or TRUTH_DEG[found.camera]
    assert (found.alpha_deg, found.beta_deg) == pytest.approx(expected, abs=0.1)


def sent(opened: AnyEmulated, camera: Camera) -> np.ndarray:
    """The picture (480, 640) that a camera sent during the latest store, rendered again."""
    shutter = opened.board.stored_frame(camera)
    segment = opened.board.cameras[camera].segment_at(shutter.readout_ps + 1)
    found: np.ndarray = segment.pixels()
    return found


def held(board: CubeSenseBoard, half: Camera) -> np.ndarray:
    """The picture (480, 640) in the memory of a camera's half; an address is row : column."""
    rows: np.ndarray = board.engine.memories[HALVES[half]].reshape(-1, 1024)
    return rows[:ROWS, :COLUMNS].copy()
