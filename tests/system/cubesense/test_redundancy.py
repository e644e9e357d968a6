"""Measurements with failed parts.

CubeSense thesis, section 3.3 and figures 3.10 and 3.11: one memory failed; one camera and the
opposite memory failed.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.board import HALVES
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.firmware_model.interface.cubesense import codes, fpga
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    Sram,
)
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.clients.cubesense.download import download_image, picture_of
from tests.system.conftest import Open
from tests.tiers import quick

from .conftest import FACING, check_right, held, sent


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


@pytest.mark.parametrize("failed", quick(Sram, 1))
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


@pytest.mark.parametrize("dead", quick(Camera, 1))
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


@pytest.mark.parametrize("gateware", ["one-search", "corrected"])
@pytest.mark.parametrize("dead", Camera)
def test_half_measures_alone_while_the_other_fpga_is_dead(
    ready: Open, dead: Camera, gateware: str
) -> None:
    """Neither the dead half's camera nor its memory is within reach."""
    alive = Camera(1 - dead)
    with ready(seed=2, profile="extended", set=f"gateware={gateware}") as opened:
        fault = opened.faults.inject("fpga-dead", target=HALVES[dead])
        own, other = (opened.client.capture_and_detect(alive, Sram(half)) for half in (alive, dead))
        check(own, CaptureResult.STORED_OWN_SRAM)
        lost = [other, *(opened.client.capture_and_detect(dead, memory) for memory in Sram)]
        assert {one.capture for one in lost} == {CaptureResult.CAMERA_TIMEOUT}
        assert {one.detect for one in lost} == {DetectResult.NONE_SCHEDULED}
        opened.faults.clear(fault)
        check(opened.client.capture_and_detect(dead, Sram(dead)), CaptureResult.STORED_OWN_SRAM)


@pytest.mark.parametrize("camera", quick(Camera, 1))
def test_image_in_the_other_memory_equals_the_camera_image(opened: Any, camera: Camera) -> None:
    other = Sram(1 - camera)
    opened.client.capture(camera, other)
    stored = held(opened.board, Camera(other))
    np.testing.assert_array_equal(stored, sent(opened, camera))
    seen = picture_of(download_image(opened.client.client, other, codes.ImageSize.SIDE_128))
    np.testing.assert_array_equal(seen, stored[::8, ::8])


DARK = EarthSunScene(nadir=(1, 0, 0), sun=(0, 0, 1))


@pytest.mark.parametrize("gateware", ["both-searches", "corrected"])
def test_only_as_printed_gateware_keeps_sun_coordinates_without_a_sun(
    ready: Open, gateware: str
) -> None:
    with ready(FACING, profile="published", set=f"gateware={gateware}") as opened:
        assert opened.client.capture_and_detect(Camera.SUN).detected
        seen = opened.board.program.state.results[Camera.SUN].first
        opened.scene = DARK
        opened.wait(0.2)
        found = opened.client.capture_and_detect(Camera.SUN)
        assert found.detect is DetectResult.SUN_NOT_FOUND
        first = opened.board.program.state.results[Camera.SUN].first
        assert first == (seen if gateware == "both-searches" else fpga.SUN_NOT_FOUND)


@pytest.mark.parametrize("camera", quick(Camera, 1))
def test_single_search_gateware_gives_the_same_direction(ready: Open, camera: Camera) -> None:
    other, found, took_s = Sram(1 - camera), {}, {}
    for gateware in ("one-search", "corrected"):
        switches = f"lens=nominal,gateware={gateware}"
        with ready(FACING, profile="published", set=switches) as opened:
            own = opened.board.engine.memories[camera.name.lower()]
            before, began_s = own.copy(), opened.time_s
            found[gateware] = opened.client.capture_and_detect(camera, other)
            took_s[gateware] = opened.time_s - began_s
            assert found[gateware].detected
            assert (own == before).all(), "nothing is written into the memory of the sender"
    one, usual = found["one-search"], found["corrected"]
    assert (one.alpha_deg, one.beta_deg) == (usual.alpha_deg, usual.beta_deg)
    expected_s = {Camera.SUN: 0.8, Camera.NADIR: 11.38}[camera]
    assert took_s["one-search"] == pytest.approx(expected_s, abs=0.4)
    assert took_s["corrected"] < 0.3
