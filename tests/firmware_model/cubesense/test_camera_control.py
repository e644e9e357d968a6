"""Camera registers over two pins: what is written, when, and how the lines move."""

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.camera_control import EXPOSURE_SETTLE_US
from cubestack.firmware_model.interface.cubesense.codes import Camera, ResetTarget, Sram
from cubestack.firmware_model.interface.cubesense.pins import CAMERA_SCL, CAMERA_SDA
from cubestack.firmware_model.mcu.requests import ReadPin, SetPin

from .harness import Harness

AT_START = {
    "COMMON_A": 0x00, "COMMON_B": 0x00, "COMMON_C": 0x04, "COMMON_H": 0x60, "COMMON_I": 0x80,
    "HSTART": 0x2F, "HSTOP": 0xCF, "VSTART": 0x05, "VSTOP": 0xF5,
    "GAIN": 0, "BLUE_GAIN": 0x80, "RED_GAIN": 0x80,
}  # fmt: skip


def capture(unit: Harness, camera: Camera = Camera.SUN) -> None:
    unit.command("CaptureOnly", Camera=camera, Sram=Sram(camera))


def test_both_cameras_are_set_up_at_start(unit: Harness) -> None:
    assert unit.cameras[Camera.SUN].registers == {**AT_START, "EXPOSURE": 1}
    assert unit.cameras[Camera.NADIR].registers == {**AT_START, "EXPOSURE": 4}


def test_camera_bus_timing_satisfies_the_camera(
    unit: Harness, caplog: pytest.LogCaptureFixture
) -> None:
    unit.cameras[Camera.NADIR].writes.clear()
    unit.log.clear()
    unit.command("Reset", Target=ResetTarget.CAMERAS)
    assert len(unit.cameras[Camera.NADIR].writes) == len(AT_START) + 1
    assert not caplog.records  # such as of too fast a clock
    risen_us = [us for us, request in unit.log if request == SetPin("NAD_SCL", 1)]
    assert np.median(np.diff(risen_us)) < 6


def test_camera_register_write_takes_fewer_than_100_pin_requests(unit: Harness) -> None:
    unit.log.clear()
    unit.command("CameraSettings1", Exposure=77, Gain=1)
    capture(unit)
    pins = (CAMERA_SCL[Camera.SUN], CAMERA_SDA[Camera.SUN])
    moves = [r for _, r in unit.log if isinstance(r, SetPin | ReadPin) and r.pin in pins]
    assert len(moves) / (len(AT_START) + 1) < 100


def test_registers_are_written_again_only_when_a_setting_changed(unit: Harness) -> None:
    camera = unit.cameras[Camera.SUN]
    camera.writes.clear()
    capture(unit)
    assert camera.writes == []
    unit.command("CameraSettings1", Exposure=2)
    capture(unit)
    assert len(camera.writes) == len(AT_START) + 1
    capture(unit)
    assert len(camera.writes) == len(AT_START) + 1


def test_capture_waits_for_a_new_exposure_to_settle(unit: Harness) -> None:
    unit.command("CameraSettings1", Exposure=2)
    unit.log.clear()
    capture(unit)
    written_us = max(
        us for us, r in unit.log if isinstance(r, SetPin) and r.pin == CAMERA_SDA[Camera.SUN]
    )
    (stored_us,) = (us for us, request in unit.log if request == SetPin("SUNEN", 0))
    assert 0 <= stored_us - written_us - EXPOSURE_SETTLE_US < 300
    # The rest of one frame, another one, and the blanking of the next.
    assert EXPOSURE_SETTLE_US > (525 + 45) * 858 / 13.5


def test_camera_reset_cycles_the_supply_and_restores_the_settings(unit: Harness) -> None:
    unit.command("CameraSettings1", Exposure=9)
    capture(unit)
    unit.log.clear()
    unit.command("Reset", Target=ResetTarget.CAMERAS)
    power = [r for _, r in unit.log if isinstance(r, SetPin) and r.pin.endswith("POWER")]
    names = ("SUN_POWER", "NAD_POWER")
    assert power == [SetPin(name, level) for level in (0, 1) for name in names]
    assert unit.cameras[Camera.SUN].registers == {**AT_START, "EXPOSURE": 9}


def test_silent_camera_is_retried_before_each_capture(unit: Harness) -> None:
    camera = unit.cameras[Camera.SUN]
    camera.answers = False
    unit.command("CameraSettings1", Exposure=9)
    camera.writes.clear()
    for _ in range(2):
        unit.log.clear()
        capture(unit)
        reads = [r for _, r in unit.log if isinstance(r, ReadPin)]
        assert len(reads) == 1  # and no byte after it
        assert unit.pins["SUN_SCL"] == unit.pins["SUN_SDA"] == 1
        assert not unit.program.cameras.acknowledged(Camera.SUN)
        assert unit.program.cameras.acknowledged(Camera.NADIR)
    camera.answers = True
    capture(unit)
    assert camera.registers == {**AT_START, "EXPOSURE": 9}
    assert unit.program.cameras.acknowledged(Camera.SUN)
