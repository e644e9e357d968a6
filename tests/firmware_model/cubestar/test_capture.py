"""getImage: the order on the pins, what can fail, and the picture's time."""

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.capture import ACK_TIMEOUT_US
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, TaskStatus
from cubestack.firmware_model.mcu.requests import AwaitPin, CameraTransfer, SetPin, StrobeRead

from .harness import FRAME_US, Harness

MODE_SELECT = REGISTERS["MODE_SELECT"].address.to_bytes(2, "big")
ENABLE = MODE_SELECT + b"\x21"
DISABLE = MODE_SELECT + b"\x20"


def test_capture_requests_have_the_documented_order(unit: Harness) -> None:
    unit.command("CaptureImage")  # sets the camera up
    unit.log.clear()
    unit.command("CaptureImage")
    steps = [request for _, request in unit.log]
    transfer = steps[9]
    assert isinstance(transfer, StrobeRead)
    assert np.shares_memory(transfer.target, unit.external_ram)
    assert (len(transfer.target), transfer.cycles) == (IMAGE_BYTES, 37)
    assert steps[:9] + steps[10:] == [
        CameraTransfer(ENABLE),
        SetPin("BANK", 0),
        SetPin("RNW", 0),
        SetPin("ENABLE", 1),
        AwaitPin("ACK", 1, ACK_TIMEOUT_US, 8),
        SetPin("ENABLE", 0),
        CameraTransfer(DISABLE),
        SetPin("RNW", 1),
        SetPin("ENABLE", 1),
        SetPin("ENABLE", 0),
        SetPin("RNW", 0),
    ]


@pytest.mark.parametrize("delay_ms", [0, 70, 1000])
def test_capture_waits_the_discard_delay_after_enabling_the_camera(
    unit: Harness, delay_ms: int
) -> None:
    unit.command("SetDiscardDelay", Delay=delay_ms)
    unit.command("CaptureImage")
    at = {request: now_us for now_us, request in unit.log if not isinstance(request, StrobeRead)}
    enabled_us = at[CameraTransfer(ENABLE)] + 3 * 90
    stored_us = next(now for now, request in unit.log if request == SetPin("ENABLE", 1))
    assert stored_us - enabled_us == pytest.approx(1000 * delay_ms, abs=20)


def test_bank_pin_is_set_before_the_store_and_kept_for_the_transfer(unit: Harness) -> None:
    unit.command("SelectImageBank", Bank=1)
    unit.log.clear()
    unit.command("CaptureImage")
    pins = [request for _, request in unit.log if isinstance(request, SetPin)]
    assert pins[0] == SetPin("BANK", 1)
    assert [request for request in pins if request.pin == "BANK"] == pins[:1]


@pytest.mark.parametrize(
    ("refused", "flag"),
    [
        (lambda data: data == ENABLE, "ISEnableError"),
        (lambda data: data == DISABLE, "ISSetupError"),  # its first use is in the set-up
        (lambda data: True, "ISSetupError"),
    ],
)
def test_capture_fails_with_a_flag_when_the_camera_refuses_a_write(
    lit: Harness, refused: object, flag: str
) -> None:
    assert callable(refused)
    lit.camera_refuses = refused
    lit.command("CaptureImage")
    assert lit.status() is TaskStatus.CAPTURE_FAILED
    assert lit.flags() == {flag}
    assert not any(isinstance(request, SetPin) for _, request in lit.log)
    assert not lit.telemetry("PerformanceParameters")["ImageCaptureSuccess"]
    lit.camera_refuses = lambda _data: False
    lit.command("CaptureAndProcess")
    assert lit.status() is TaskStatus.CALCULATED


def test_frame_is_processed_although_the_camera_refuses_the_disable(lit: Harness) -> None:
    lit.command("CaptureImage")
    lit.camera_refuses = lambda data: data == DISABLE
    lit.command("CaptureAndProcess")
    assert lit.status() is TaskStatus.CALCULATED
    assert lit.flags() == {"ISDisableError"}


@pytest.mark.parametrize("failure", ["no frame", "not disabled"])
def test_failed_camera_is_set_up_again_by_the_next_capture(unit: Harness, failure: str) -> None:
    unit.command("CaptureImage")
    set_up = dict(unit.camera)
    unit.camera.clear()  # it lost its supply
    if failure == "no frame":
        unit.frame_us = None
    else:
        unit.camera_refuses = lambda data: data == DISABLE
    unit.command("CaptureImage")
    assert len(unit.camera) < len(set_up)
    unit.frame_us = FRAME_US
    unit.camera_refuses = lambda _data: False
    unit.command("CaptureImage")
    assert unit.camera == set_up


def test_capture_times_out_when_no_frame_arrives(lit: Harness) -> None:
    lit.command("CaptureImage")
    lit.frame_us = None
    lit.log.clear()
    start_us = lit.now_us
    lit.command("CaptureImage")
    assert lit.now_us - start_us == pytest.approx(ACK_TIMEOUT_US + 70_000, rel=0.01)
    assert lit.status() is TaskStatus.CAPTURE_FAILED
    assert lit.flags() == {"ImageCaptureError"}
    assert lit.pins == {"ENABLE": 0, "RNW": 0, "BANK": 0}
    assert lit.camera_writes[-1] == DISABLE
    assert not any(isinstance(request, StrobeRead) for _, request in lit.log)
    lit.command("DetectStars")  # the picture before is not taken for this one
    assert lit.status() is TaskStatus.DETECTION_FAILED
    lit.frame_us = FRAME_US
    lit.command("CaptureAndProcess")
    assert lit.status() is TaskStatus.CALCULATED


@pytest.mark.parametrize(("delay_ms", "frame_us"), [(70, FRAME_US), (1000, 1_900_000)])
def test_phase_times_of_a_capture_match_delay_frame_and_transfer(
    unit: Harness, delay_ms: int, frame_us: int
) -> None:
    unit.frame_us = frame_us
    unit.command("SetDiscardDelay", Delay=delay_ms)
    unit.command("CaptureImage")
    phases = unit.telemetry("PhaseTimes")
    assert phases["Discard"] == pytest.approx(1000 * delay_ms, abs=10)
    assert phases["Capture"] == pytest.approx(frame_us, abs=10)
    assert phases["Transfer"] == pytest.approx(IMAGE_BYTES * 37 / 48, abs=10)
    camera = unit.telemetry("CameraTiming")
    assert camera["CaptureTime"] == pytest.approx(delay_ms + frame_us / 1000, abs=1)
    summary = unit.telemetry("TimingSummary")
    assert summary["ImageCaptureTime"] == pytest.approx(delay_ms + frame_us / 1000 + 404, abs=2)


@pytest.mark.parametrize(("rate", "exposure"), [(7, 0), (7, 500), (7, 60_000), (30, 0), (6, 10)])
def test_image_time_is_mid_exposure(lit: Harness, rate: int, exposure: int) -> None:
    lit.command("SetFrameRate", FrameRate=rate)
    lit.command("Exposure", exposure=exposure)
    lit.log.clear()
    lit.command("CaptureAndProcess")
    line_us = 132.2
    frame_lines = round(27e6 / (rate * 1322))
    exposed = min(exposure or frame_lines, frame_lines - 1)
    ack_us = next(us for us, what in lit.log if what == SetPin("ENABLE", 0))
    expected_us = ack_us - (256 + exposed / 2) * line_us
    assert lit.telemetry("AttitudeQuaternion")["ImageTime"] == pytest.approx(
        expected_us / 1000, abs=1.1
    )


def test_frame_counter_counts_test_patterns_uploads_and_captures(lit: Harness) -> None:
    lit.command("CaptureTestPatern", TestPaternType=0)
    lit.command("UploadImage", "CaptureAndProcess")
    assert lit.telemetry("AttitudeQuaternion")["FrameCounter"] == 3
