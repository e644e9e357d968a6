"""What still measures when parts fail.

CubeSense thesis, section 3.3 and figures 3.10 and 3.11: one memory failed; one camera and the
opposite memory failed.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    ImageSize,
    Sram,
    SramSelection,
)
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.clients.cubesense.download import download_image, picture_of
from cubestack.host.devices.emulated import AnyEmulated
from tests.system.conftest import Open

from .conftest import NADIR_DEG, SUN_DEG

TRUTH = {Camera.SUN: SUN_DEG, Camera.NADIR: NADIR_DEG}


def check(measured: Measurement, capture: CaptureResult) -> None:
    assert measured.capture is capture
    assert measured.detect is DetectResult.SUCCESS
    found = (measured.alpha_deg, measured.beta_deg)
    np.testing.assert_allclose(found, TRUTH[measured.camera], atol=0.1)


@pytest.fixture
def opened(ready: Open, scene: EarthSunScene) -> Iterator[AnyEmulated]:
    with ready(scene, seed=2) as made:
        yield made


def latch_up(opened: AnyEmulated, memory: Sram) -> None:
    """For good."""
    opened.board.faults.inject("latch-up", target=memory.name, lasting=True)


@pytest.mark.parametrize("failed", Sram)
def test_with_one_memory_failed_both_cameras_measure_in_the_other(
    opened: AnyEmulated, failed: Sram
) -> None:
    latch_up(opened, failed)
    opened.client.client.pause(0.1)
    assert opened.client.power().over_current[failed]
    good = Sram(1 - failed)
    for camera in Camera:
        own = Sram(camera) is good
        check(
            opened.client.capture_and_detect(camera, good),
            CaptureResult.STORED_OWN_SRAM if own else CaptureResult.STORED_OTHER_SRAM,
        )
        lost = opened.client.capture_and_detect(camera, failed)
        assert lost.capture is CaptureResult.SRAM_OVER_CURRENT
        assert lost.detect is DetectResult.NONE_SCHEDULED


@pytest.mark.parametrize("dead", Camera)
def test_with_a_camera_and_the_opposite_memory_failed_the_other_camera_measures(
    opened: AnyEmulated, dead: Camera
) -> None:
    """The dead camera gives no clock, yet its half's memory is written and read."""
    alive = Camera(1 - dead)
    opened.board.faults.inject("camera-dead", target=HALVES[dead])
    latch_up(opened, Sram(alive))
    opened.client.client.pause(0.1)
    check(opened.client.capture_and_detect(alive, Sram(dead)), CaptureResult.STORED_OTHER_SRAM)
    gone = opened.client.capture_and_detect(dead, Sram(dead))
    assert gone.capture is CaptureResult.CAMERA_TIMEOUT
    assert gone.detect is DetectResult.NONE_SCHEDULED


@pytest.mark.parametrize("camera", Camera)
def test_picture_in_the_other_memory_is_what_the_camera_sent(
    opened: AnyEmulated, memory: Callable[..., Any], sent: Callable[..., Any], camera: Camera
) -> None:
    other = Sram(1 - camera)
    opened.client.capture(camera, other)
    stored = memory(opened, Camera(other))
    np.testing.assert_array_equal(stored, sent(opened, camera))
    seen = picture_of(download_image(opened.client.client, other, ImageSize.SIDE_128))
    np.testing.assert_array_equal(seen, stored[::8, ::8])


def test_latch_up_is_cut_off_and_cleared_by_command(opened: AnyEmulated) -> None:
    cubesense = opened.client
    opened.board.power.latch_up("SRAM1")
    cubesense.client.pause(0.05)
    power = cubesense.power()
    assert power.over_current == (True, False)
    assert power.current_sram_ma[0] < 1
    cubesense.clear_over_current(SramSelection.SRAM1)
    cubesense.client.pause(0.1)
    power = cubesense.power()
    assert power.over_current == (False, False)
    assert power.current_sram_ma[0] == pytest.approx(4.6, abs=0.3)
    check(cubesense.capture_and_detect(Camera.SUN), CaptureResult.STORED_OWN_SRAM)
