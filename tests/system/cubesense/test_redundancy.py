"""Measurements with failed parts.

CubeSense thesis, section 3.3 and figures 3.10 and 3.11: one memory failed; one camera and the
opposite memory failed.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.clients.cubesense.download import download_image, picture_of
from tests.system.conftest import Open

from .conftest import check_right, held, sent


@pytest.fixture
def opened(ready: Open) -> Iterator[Any]:
    with ready(seed=2) as made:
        yield made


def check(found: Measurement, capture: CaptureResult) -> None:
    assert found.capture is capture
    check_right(found)


def latch_up(opened: Any, memory: Sram) -> None:
    opened.faults.inject("latch-up", target=memory.name, lasting=True)
    opened.client.client.pause(0.1)


@pytest.mark.parametrize("failed", Sram)
def test_both_cameras_measure_with_one_memory_failed(opened: Any, failed: Sram) -> None:
    latch_up(opened, failed)
    assert opened.client.power().over_current[failed]
    good = Sram(1 - failed)
    for camera in Camera:
        stored = "STORED_OWN_SRAM" if Sram(camera) is good else "STORED_OTHER_SRAM"
        check(opened.client.capture_and_detect(camera, good), CaptureResult[stored])
        lost = opened.client.capture_and_detect(camera, failed)
        assert lost.capture is CaptureResult.SRAM_OVER_CURRENT
        assert lost.detect is codes.DetectResult.NONE_SCHEDULED


@pytest.mark.parametrize("dead", Camera)
def test_camera_measures_with_the_other_camera_and_its_own_memory_failed(
    opened: Any, dead: Camera
) -> None:
    """The failed camera sends no clock, but the memory of its half still works."""
    alive = Camera(1 - dead)
    opened.faults.inject("camera-dead", target=HALVES[dead])
    latch_up(opened, Sram(alive))
    check(opened.client.capture_and_detect(alive, Sram(dead)), CaptureResult.STORED_OTHER_SRAM)
    gone = opened.client.capture_and_detect(dead, Sram(dead))
    assert gone.capture is CaptureResult.CAMERA_TIMEOUT
    assert gone.detect is codes.DetectResult.NONE_SCHEDULED


@pytest.mark.parametrize("camera", Camera)
def test_picture_in_the_other_memory_equals_the_camera_picture(opened: Any, camera: Camera) -> None:
    other = Sram(1 - camera)
    opened.client.capture(camera, other)
    stored = held(opened.board, Camera(other))
    np.testing.assert_array_equal(stored, sent(opened, camera))
    seen = picture_of(download_image(opened.client.client, other, codes.ImageSize.SIDE_128))
    np.testing.assert_array_equal(seen, stored[::8, ::8])
