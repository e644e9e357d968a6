"""getImage: the order on the pins, what can fail, and the picture's time."""

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.capture import ACK_TIMEOUT_US
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, TaskStatus
from cubestack.firmware_model.mcu.requests import (
    AwaitPin,
    CameraTransfer,
    SetPin,
    Sleep,
    StrobeRead,
)

from .bench import FRAME_US, Bench
from .sky import Sky

MODE_SELECT = REGISTERS["MODE_SELECT"].address.to_bytes(2, "big")
ENABLE = MODE_SELECT + b"\x21"
DISABLE = MODE_SELECT + b"\x20"


def test_the_order_of_a_capture(bench: Bench) -> None:
    bench.command("CaptureImage")  # sets the camera up
    bench.log.clear()
    bench.command("CaptureImage")
    steps = [request for _, request in bench.log]
    transfer = steps[9]
    assert isinstance(transfer, StrobeRead)
    assert np.shares_memory(transfer.target, bench.external_ram)
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
def test_the_first_frame_is_left_to_pass(bench: Bench, delay_ms: int) -> None:
    bench.command("SetDiscardDelay", Delay=delay_ms)
    bench.command("CaptureImage")
    at = {request: now_us for now_us, request in bench.log if not isinstance(request, StrobeRead)}
    enabled_us = at[CameraTransfer(ENABLE)] + 3 * 90
    stored_us = next(now for now, request in bench.log if request == SetPin("ENABLE", 1))
    assert stored_us - enabled_us == pytest.approx(1000 * delay_ms, abs=20)


def test_the_telecommands_wait_is_not_cut_short(bench: Bench) -> None:
    waits = []
    bench.on_request = lambda request: waits.append(request) if isinstance(request, Sleep) else None
    bench.send("CaptureImage")
    bench.run()
    assert [wait.wakeable for wait in waits] == [False, True]  # the last one: idle


def test_the_bank_is_chosen_before_storing_and_kept_for_the_transfer(bench: Bench) -> None:
    bench.command("SelectImageBank", Bank=1)
    bench.log.clear()
    bench.command("CaptureImage")
    pins = [request for _, request in bench.log if isinstance(request, SetPin)]
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
def test_a_camera_that_does_not_answer(bench: Bench, sky: Sky, refused: object, flag: str) -> None:
    bench.picture = sky.picture
    assert callable(refused)
    bench.camera_refuses = refused
    bench.command("CaptureImage")
    assert bench.status() is TaskStatus.CAPTURE_FAILED
    assert bench.flags() == {flag}
    assert not any(isinstance(request, SetPin) for _, request in bench.log)
    assert not bench.telemetry("PerformanceParameters")["ImageCaptureSuccess"]
    bench.camera_refuses = lambda _data: False
    bench.command("CaptureAndProcess")
    assert bench.status() is TaskStatus.CALCULATED


def test_a_camera_that_can_not_be_disabled_gives_a_good_picture(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.camera_refuses = lambda data: data == DISABLE
    bench.command("CaptureAndProcess")
    assert bench.status() is TaskStatus.CALCULATED
    assert bench.flags() == {"ISDisableError"}


@pytest.mark.parametrize("failure", ["no frame", "not disabled"])
def test_a_camera_that_failed_is_set_up_again(bench: Bench, failure: str) -> None:
    bench.command("CaptureImage")
    set_up = dict(bench.camera)
    bench.camera.clear()  # it lost its supply
    if failure == "no frame":
        bench.frame_us = None
    else:
        bench.camera_refuses = lambda data: data == DISABLE
    bench.command("CaptureImage")
    assert len(bench.camera) < len(set_up)
    bench.frame_us = FRAME_US
    bench.camera_refuses = lambda _data: False
    bench.command("CaptureImage")
    assert bench.camera == set_up


def test_a_frame_that_never_comes(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.frame_us = None
    bench.log.clear()
    start_us = bench.now_us
    bench.command("CaptureImage")
    assert bench.now_us - start_us == pytest.approx(ACK_TIMEOUT_US + 70_000, rel=0.01)
    assert bench.status() is TaskStatus.CAPTURE_FAILED
    assert bench.flags() == {"ImageCaptureError"}
    assert bench.pins == {"ENABLE": 0, "RNW": 0, "BANK": 0}
    assert bench.camera_writes[-1] == DISABLE
    assert not any(isinstance(request, StrobeRead) for _, request in bench.log)
    bench.command("DetectStars")  # the picture before is not taken for this one
    assert bench.status() is TaskStatus.DETECTION_FAILED
    bench.frame_us = FRAME_US
    bench.command("CaptureAndProcess")
    assert bench.status() is TaskStatus.CALCULATED


def test_the_times_of_a_capture(bench: Bench) -> None:
    bench.command("CaptureImage")
    phases = bench.telemetry("PhaseTimes")
    assert phases["Discard"] == pytest.approx(70_000, abs=10)
    assert phases["Capture"] == pytest.approx(FRAME_US, abs=10)
    assert phases["Transfer"] == pytest.approx(IMAGE_BYTES * 37 / 48, abs=10)
    camera = bench.telemetry("CameraTiming")
    assert camera["CaptureTime"] == pytest.approx((70_000 + FRAME_US) / 1000, abs=1)
    summary = bench.telemetry("TimingSummary")
    assert summary["ImageCaptureTime"] == pytest.approx(860, abs=2)


@pytest.mark.parametrize(("rate", "exposure"), [(7, 0), (7, 500), (7, 60_000), (30, 0), (6, 10)])
def test_the_pictures_time_is_its_mid_exposure(
    bench: Bench, sky: Sky, rate: int, exposure: int
) -> None:
    bench.picture = sky.picture
    bench.command("SetFrameRate", FrameRate=rate)
    bench.command("Exposure", exposure=exposure)
    bench.log.clear()
    bench.command("CaptureAndProcess")
    line_us = 132.2
    frame_lines = round(27e6 / (rate * 1322))
    exposed = min(exposure or frame_lines, frame_lines - 1)
    ack_us = next(us for us, what in bench.log if what == SetPin("ENABLE", 0))
    expected_us = ack_us - (256 + exposed / 2) * line_us
    assert bench.telemetry("AttitudeQuaternion")["ImageTime"] == pytest.approx(
        expected_us / 1000, abs=1.1
    )


def test_pictures_are_counted(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureTestPatern", TestPaternType=0)
    bench.command("UploadImage")
    bench.command("CaptureAndProcess")
    assert bench.telemetry("AttitudeQuaternion")["FrameCounter"] == 3
