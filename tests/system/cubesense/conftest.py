"""What the tests of a whole CubeSense share."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, IMAGE_BYTES, ROWS, Camera
from cubestack.host.devices.emulated import AnyEmulated
from tests.system.conftest import Open

SUN_DEG = (20.0, 10.0)
NADIR_DEG = (-8.0, 12.0)


@pytest.fixture
def scene() -> EarthSunScene:
    """Sun and Earth in view of their cameras."""
    return EarthSunScene.facing(sun_deg=SUN_DEG, nadir_deg=NADIR_DEG)


@pytest.fixture(scope="session")
def device_name() -> str:
    return "cubesense"


@pytest.fixture
def ready(session: Open) -> Open:
    """Opens the device, looking at a scene, and waits until its cameras are set up."""

    def start(scene: Any, **options: Any) -> AnyEmulated:
        opened = session(scene, **options)
        opened.client.client.pause(0.3)
        return opened

    return start


@pytest.fixture
def sent() -> Callable[[AnyEmulated, Camera], np.ndarray]:
    """The picture (480, 640) that a camera sent while one was stored last, rendered anew."""

    def look(opened: AnyEmulated, camera: Camera) -> np.ndarray:
        shutter = opened.board.stored_frame(camera)
        assert shutter is not None
        segment = opened.board.cameras[camera].segment_at(shutter.readout_ps + 1)
        assert segment is not None
        assert segment.pixels is not None
        return segment.pixels()

    return look


@pytest.fixture
def memory() -> Callable[[AnyEmulated, Camera], np.ndarray]:
    """The picture (480, 640) in the memory of a camera's half, looked at from outside."""

    def read(opened: AnyEmulated, half: Camera) -> np.ndarray:
        rows = opened.board.engine.memories[HALVES[half]].reshape(-1, 1024)[:ROWS, :COLUMNS]
        assert rows.size == IMAGE_BYTES
        return rows

    return read
