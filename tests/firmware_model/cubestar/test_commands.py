import numpy as np
import pytest

from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.commands import STREAM_BACKLOG_BYTES
from cubestack.firmware_model.cubestar.configuration import (
    camera_parameters,
    detection_config,
    field_cosine,
)
from cubestack.firmware_model.cubestar.detection import DetectionConfig
from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.mcu.requests import Sleep
from cubestack.firmware_model.node.state import Settings

from ..sessions import Step, as_recorded
from .harness import FRAME_US, Harness


def test_telecommands_are_executed_in_order(unit: Harness) -> None:
    for exposure in (1, 2, 3, 4):
        unit.send("Exposure", exposure=exposure)
    unit.shown("Exposure", exposure=0)
    unit.run()
    unit.shown("Exposure", exposure=4)


def test_processed_flag_is_set_when_the_last_telecommand_is_done(unit: Harness) -> None:
    unit.shown("TcmdProcessed", Processed=1)
    unit.send("CaptureImage")
    unit.send("Exposure", exposure=1)
    unit.shown("TcmdProcessed", Processed=0)
    unit.run(until_us=unit.now_us + FRAME_US)
    unit.shown("TcmdProcessed", Processed=0)
    unit.run()
    unit.shown("TcmdProcessed", Processed=1)


@pytest.mark.parametrize("name", ["Reset", "MCUReset"])
def test_resetting_telecommand_is_not_marked_processed_before_the_reset(
    unit: Harness, name: str
) -> None:
    seen: dict[int, set[int]] = {0: set(), 1: set()}
    unit.on_request = lambda _request: seen[len(unit.resets)].add(
        unit.telemetry("TcmdProcessed")["Processed"]
    )
    unit.command(name)
    assert seen == {0: {0}, 1: {1}}


@pytest.mark.parametrize("name", ["Reset", "MCUReset", "TestWDG"])
def test_reset_drops_waiting_telecommands(unit: Harness, name: str) -> None:
    unit.send(name)
    unit.command("Exposure", exposure=9)
    unit.shown("Exposure", exposure=0)


def test_image_stream_waits_for_the_uart_backlog(unit: Harness) -> None:
    unit.command("UploadImage")
    unit.backlog = STREAM_BACKLOG_BYTES + 1
    start_us = unit.now_us
    unit.send("StreamDownImage")
    unit.run(until_us=start_us + 1_000_000)
    assert unit.received() == []
    unit.backlog = STREAM_BACKLOG_BYTES
    unit.run()
    assert len(unit.received()) == 4096


@pytest.mark.parametrize("name", ["TestWDG", "CaptureImage"])
def test_interrupt_does_not_shorten_a_wait(unit: Harness, name: str) -> None:
    sleeps = []
    unit.on_request = lambda request: sleeps.append(request) if isinstance(request, Sleep) else None
    unit.send(name)
    unit.send("Exposure", exposure=1)  # wakes
    unit.run()
    assert not sleeps[0].wakeable


def test_image_streaming_is_charged_per_pixel(unit: Harness) -> None:
    """A turn of the loop and a bus cycle for each of 1024 x 512 pixels."""
    unit.command("UploadImage")
    before = unit.meter.counts.copy()
    unit.command("StreamDownImage")
    paid = unit.meter.counts - before
    assert paid["ebi_read"] == 1024 * 512
    assert 1024 * 512 <= paid["loop"] < 1.1 * 1024 * 512


def reset_settings() -> Settings:
    return Settings(INTERFACE, SETTING_COMMANDS)


def test_reset_values_are_the_published_ones() -> None:
    assert detection_config(reset_settings()) == DetectionConfig()
    # Figure 5.12, coefficients with inverted sign, and the focal length of section 5.4.
    published = CameraParameters(
        6.28, 1147.5, 1147.4, 539.0, 175.5, 0.32358, -0.12456, -0.00414, 0.00624
    )
    assert vars(camera_parameters(reset_settings())) == pytest.approx(vars(published), rel=1e-6)


def test_stored_settings_reach_the_processing_configuration() -> None:
    settings = reset_settings()
    region = {"StepSize": 4, "Xstart": 10, "Xend": 20, "Ystart": 30, "Yend": 40}
    settings.put("setDetectionRegion", region)
    settings.put("setDetectionThresholds", {"DetectionThreshold": 50, "StarThreshold": 51})
    settings.put("setStarPixels", {"MinPixels": 7, "MaxPixels": 70})
    limits = {"GridSize": 9, "MaxStars": 11, "MaxInvalidStars": 12, "MaxNoise": 13}
    settings.put("setDetectionVariables", limits)
    assert detection_config(settings) == DetectionConfig(
        step=4,
        x_start=10,
        x_end=21,  # the telecommand includes the end
        y_start=30,
        y_end=41,
        detection_threshold=50,
        star_threshold=51,
        min_pixels=7,
        max_pixels=70,
        grid_size=9,
        max_stars=11,
        max_invalid=12,
        max_noise=13,
    )
    settings.put("setFocalLength", {"FocalLength": 8.0})
    settings.put("setFocalLengthComponents", {"Fx": 1001.0, "Fy": 1002.0})
    settings.put("setPrincipalPoint", {"Cx": 501.0, "Cy": 252.0})
    settings.put("setRadialDistortionGains", {"K1": 0.1, "K2": 0.2})
    settings.put("setTangentalDistortionGains", {"P1": 0.3, "P2": 0.4})
    expected = CameraParameters(8.0, 1001.0, 1002.0, 501.0, 252.0, 0.1, 0.2, 0.3, 0.4)
    assert camera_parameters(settings) == expected


@pytest.mark.parametrize(("cx", "cy"), [(539.0, 175.5), (512.0, 256.0), (100.0, 500.0)])
def test_field_cosine_reaches_to_the_farthest_corner(cx: float, cy: float) -> None:
    settings = reset_settings()
    settings.put("setPrincipalPoint", {"Cx": cx, "Cy": cy})
    x, y = np.meshgrid([0, 1024], [0, 512])
    farthest = np.hypot(x - cx, y - cy).max()
    expected = np.cos(np.arctan(farthest * 0.0056 / 6.28))
    assert field_cosine(camera_parameters(settings)) == pytest.approx(expected, rel=2e-7)


def test_unsupported_settings_are_clamped_to_the_nearest_supported() -> None:
    settings = Settings(INTERFACE, SETTING_COMMANDS)
    wide = {"GridSize": 4, "MaxStars": 99, "MaxInvalidStars": 50, "MaxNoise": 13}
    settings.put("setDetectionVariables", wide)
    config = detection_config(settings)
    assert (config.grid_size, config.max_stars, config.max_invalid) == (5, 20, 50)
    settings.put("setDetectionVariables", wide | {"GridSize": 15, "MaxStars": 0})
    settings.put("setDetectionRegion", settings.all("setDetectionRegion") | {"StepSize": 0})
    config = detection_config(settings)
    assert (config.grid_size, config.max_stars, config.step) == (15, 1, 1)


EXPOSURE = INTERFACE.telecommand("Exposure")
GOOD = bytes([EXPOSURE.id]) + EXPOSURE.pack(exposure=5)


def test_counters_count_accepted_telecommands_and_answered_telemetry(unit: Harness) -> None:
    unit.uart(encode_frame(GOOD) + encode_frame(b"\x63") + encode_frame(b"\xfe"))
    unit.i2c_write(GOOD)
    unit.telemetry("IDMargin")
    values = unit.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["TlmCount"]) == (2, 1)
    assert unit.telemetry("ExtendedIdentification")["TlmCount"] == 2


def test_link_is_idle_only_between_frames_and_transfers(unit: Harness) -> None:
    link = unit.program.link
    assert link.idle
    link.uart_byte(0x1F)
    assert not link.idle
    link.uart_silence()
    assert link.idle
    link.i2c_start(False)
    assert not link.idle
    link.i2c_stop()
    assert link.idle
    unit.backlog = 1
    assert not link.idle
    unit.backlog = 0
    unit.send("Exposure")
    assert not link.idle
    unit.run()
    assert link.idle


def test_second_read_of_one_i2c_transfer_continues_the_answer(unit: Harness) -> None:
    link = unit.program.link
    link.i2c_start(False)
    link.i2c_write(128)
    link.i2c_start(True)
    first = bytes(link.i2c_read() for _ in range(3))
    link.i2c_start(True)
    rest = bytes(link.i2c_read() for _ in range(5))
    link.i2c_stop()
    assert (first + rest)[:2] == bytes([5, 3])
    assert unit.i2c_read(8, 128)[:4] == (first + rest)[:4]


STEPS: list[Step] = [
    ("CaptureImage", {}),
    ("DetectStars", {}),
    ("IDStars", {}),
    ("SelectBestStars", {}),
    ("EstimateAttitude", {}),
    ("setTrackingMode", {"RightAscension": 1.0, "Declination": 0.3}),
    ("CaptureAndProcess", {}),
    ("setIDMode", {"IdMode": 1}),
    ("CaptureAndProcess", {}),
    ("CaptureAndProcess", {}),
    ("ProcessImage", {}),
    ("TogglePowerSW", {}),
    ("TogglePowerSW", {}),
    ("CaptureTestPatern", {}),
    ("DetectStars", {}),
    ("UploadImage", {}),
    ("UploadBlock", {"BlockNumber": 0, "Data": bytes(range(128))}),
    ("ImageBlockSet", {"BlockNumber": 5}),
    ("StreamDownImage", {}),
    ("SelectImageBank", {"Bank": 1}),
    ("SetFrameRate", {}),
    ("SetDiscardDelay", {}),
    ("WriteTo_IS_Register", {}),
    ("ReadFrom_IS_Register", {}),
    ("WriteCameraRegister", {}),
    ("SelectCameraRegister", {}),
    ("SaveConfig", {}),
    ("ReadConfig", {}),
    ("TestSRAM", {}),
    ("TestWDG", {}),
    ("MCUReset", {}),
    ("Reset", {}),
    ("CaptureAndProcess", {}),
]


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_cubestar_session_matches_its_recording(lit: Harness, profile: str) -> None:
    as_recorded(lit, f"CubeStar session, {profile}", STEPS)


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_cubestar_loop_matches_its_recording(lit: Harness, profile: str) -> None:
    lit.start_loop(5.5)
    as_recorded(lit, f"CubeStar loop, {profile}", [])
