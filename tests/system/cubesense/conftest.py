"""What the tests of a whole CubeSense share."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, IMAGE_BYTES, ROWS, Camera
from cubestack.host.devices.emulated import AnyEmulated, open_device

Frames = list[dict[str, Any]]

SUN_DEG = (20.0, 10.0)
NADIR_DEG = (-8.0, 12.0)


@pytest.fixture
def scene() -> EarthSunScene:
    """Sun and Earth in view of their cameras."""
    return EarthSunScene.facing(sun_deg=SUN_DEG, nadir_deg=NADIR_DEG)


@pytest.fixture
def opened() -> Callable[..., AnyEmulated]:
    """Opens a device that looks at a scene."""
    return partial(open_device, "cubesense")


@pytest.fixture(scope="session")
def measure(measure_device: Callable[..., Frames]) -> Callable[..., Frames]:
    """`cubestack measure cubesense --json` with more arguments; the results that it prints."""
    return partial(measure_device, "cubesense")


@pytest.fixture
def sent() -> Callable[[AnyEmulated, Camera], np.ndarray]:
    """The picture (480, 640) that a camera sent while one was stored last, rendered anew."""

    def look(session: AnyEmulated, camera: Camera) -> np.ndarray:
        shutter = session.board.stored_frame(camera)
        assert shutter is not None
        segment = session.board.cameras[camera].segment_at(shutter.readout_ps + 1)
        assert segment is not None
        assert segment.pixels is not None
        return segment.pixels()

    return look


@pytest.fixture
def memory() -> Callable[[AnyEmulated, Camera], np.ndarray]:
    """The picture (480, 640) in the memory of a camera's half, looked at from outside."""

    def read(session: AnyEmulated, half: Camera) -> np.ndarray:
        rows = session.board.engine.memories[HALVES[half]].reshape(-1, 1024)[:ROWS, :COLUMNS]
        assert rows.size == IMAGE_BYTES
        return rows

    return read
