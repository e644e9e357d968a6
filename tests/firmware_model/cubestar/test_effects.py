import numpy as np
import pytest

from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.interface import cubestar
from cubestack.firmware_model.interface.codec.switch_messages import shown_values
from cubestack.firmware_model.interface.cubestar import TaskStatus
from cubestack.firmware_model.mcu.requests import Pay, Request, SetPin

from ..registry import registered_in
from .harness import Harness
from .sky import Sky

EFFECTS: dict[str, object] = {}

telecommand = registered_in(EFFECTS)  #: Decorator: the test shows what the named telecommands do


def test_telecommands_handled_tested_and_declared_are_the_same(unit: Harness) -> None:
    declared = {message.name for message in cubestar.INTERFACE.telecommands}
    assert unit.program.commands.handled == EFFECTS.keys() == declared


def image(unit: Harness) -> np.ndarray:
    return unit.external_ram[: cubestar.IMAGE_BYTES].reshape(512, 1024)


CENTROID = ("X_Coordinate", "Y_Coordinate")
POINT = ("X_CorrectedCoordinate", "Y_CorrectedCoordinate")


def first(unit: Harness, sky: Sky, *fields: str, frame: str = "StarPositions") -> np.ndarray:
    unit.picture = sky.picture
    unit.command("CaptureImage", "DetectStars")
    values = unit.telemetry(frame)
    return np.array([values[name] for name in fields])


def first_vector(unit: Harness, sky: Sky) -> np.ndarray:
    return first(unit, sky, "VbX", "VbY", "VbZ", frame="BodyUnitVectors")


# --- node and configuration -----------------------------------------------------------------------


@telecommand("TogglePowerSW")
def test_toggle_power_sw_switches_the_imager(unit: Harness) -> None:
    unit.command("TogglePowerSW")
    assert unit.switches == {"memory": True, "imager": False}
    assert unit.telemetry("PowerStatus")["Status"] == 0
    unit.command("TogglePowerSW")
    assert unit.switches == {"memory": True, "imager": True}
    assert unit.telemetry("PowerStatus")["Status"] == 1
    unit.command("CaptureImage")
    assert unit.status() is TaskStatus.CAPTURED


@telecommand("Reset")
def test_reset_restores_saved_settings(unit: Harness) -> None:
    unit.command("Exposure", exposure=7)
    unit.command("SaveConfig")
    unit.command("Exposure", exposure=9)
    unit.command("SetDiscardDelay", Delay=1)
    unit.telemetry("IDMargin")
    unit.uart(b"noise")
    unit.command("TogglePowerSW", "Reset")
    assert unit.resets == [cubestar.ResetCause.SYSTEM_REQUEST]
    assert unit.telemetry("ExtendedIdentification")["TcmdCount"] == 0
    assert unit.flags() == set()
    unit.shown("Exposure", exposure=7)
    assert unit.telemetry("LoopStatus")["DiscardDelay"] == 70
    assert unit.switches["imager"]


@telecommand("MCUReset")
def test_mcu_reset_keeps_settings_and_counts_the_cause(unit: Harness) -> None:
    unit.command("Exposure", exposure=9)
    unit.command("TestSRAM", "MCUReset")
    assert unit.resets == [cubestar.ResetCause.SYSTEM_REQUEST]
    unit.shown("Exposure", exposure=9)
    assert unit.telemetry("SRAMTestResults")["TestResult"] == cubestar.MemoryTest.NOT_RUN
    values = unit.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["ResetCause"]) == (3, cubestar.ResetCause.SYSTEM_REQUEST)


@telecommand("setDelayTimerTimeout")
def test_set_delay_timer_timeout_delays_the_loop(unit: Harness) -> None:
    unit.command("setDelayTimerTimeout", Time=40)
    unit.shown("DelayTime", Timeout=40)
    start_us = unit.now_us
    unit.send("Trigger")
    unit.run(until_us=start_us + 3_000_000)
    enabled = [us for us, what in unit.log if what == SetPin("ENABLE", 1)]
    assert enabled[0] - start_us == pytest.approx(400_000 + 70_000, abs=5_000)


@telecommand("ClearErrorFlags")
def test_clear_error_flags_telecommand_clears_all_flags(unit: Harness) -> None:
    assert unit.flags() == set()
    unit.command("IDStars")
    unit.uart(b"noise")
    assert unit.flags() == {"StatusError", "UART_ProtocolError"}
    unit.command("ClearErrorFlags")
    assert unit.flags() == set()


@telecommand("SaveConfig", "ReadConfig", "ClearConfig")
def test_configuration_is_saved_read_and_cleared(unit: Harness) -> None:
    unit.command("Exposure", exposure=5)
    unit.command("setPrincipalPoint", Cx=1.5, Cy=2.5)
    unit.command("SaveConfig")
    unit.command("Exposure", exposure=6)
    unit.command("ReadConfig")
    unit.shown("Exposure", exposure=5)
    unit.command("Exposure", exposure=6)
    unit.power_on()
    unit.shown("Exposure", exposure=5)
    unit.shown("PrincipalPoint", Cx=1.5, Cy=2.5)
    unit.command("ClearConfig")
    unit.shown("Exposure", exposure=0)
    unit.command("Exposure", exposure=6)
    unit.power_on()
    unit.shown("Exposure", exposure=0)


@telecommand("TestSRAM")
def test_sram_test_telecommand_reports_passed_or_failed(unit: Harness) -> None:
    unit.shown("SRAMTestResults", TestResult=cubestar.MemoryTest.NOT_RUN)
    unit.command("CaptureImage", "TestSRAM")
    unit.shown("SRAMTestResults", TestResult=cubestar.MemoryTest.PASSED)
    unit.command("DetectStars")
    assert "StatusError" in unit.flags()  # the picture is lost

    def stuck(request: Request) -> None:
        if isinstance(request, Pay):
            unit.external_ram[777_777] |= 0x10

    unit.on_request = stuck
    unit.command("TestSRAM")
    unit.shown("SRAMTestResults", TestResult=cubestar.MemoryTest.FAILED)


@telecommand("TestWDG", "ClearWDGResetCounter")
def test_watchdog_test_resets_after_its_period_and_counts(unit: Harness) -> None:
    unit.command("Exposure", exposure=9)
    start_us = unit.now_us
    unit.send("TestWDG")
    unit.run(until_us=start_us + WATCHDOG_US // 2)
    assert unit.telemetry("TcmdProcessed") == {"Processed": 0}  # it hangs, but answers
    unit.run()
    assert unit.now_us - start_us == pytest.approx(WATCHDOG_US, rel=0.01)
    assert unit.resets == [cubestar.ResetCause.WATCHDOG]
    values = unit.telemetry("ExtendedIdentification")
    assert values["ResetCause"] == cubestar.ResetCause.WATCHDOG
    assert values["WDGResetCount"] == 1
    assert values["TlmCount"] == 1  # counted while it hung
    unit.shown("Exposure", exposure=9)
    unit.command("TestWDG")
    assert unit.telemetry("LogStatus")["WDGcounter"] == 2
    unit.command("ClearWDGResetCounter")
    assert unit.telemetry("ExtendedIdentification")["WDGResetCount"] == 0
    assert unit.telemetry("LogStatus")["WDGcounter"] == 0


@telecommand("Trigger", "StopLoop")
def test_trigger_starts_and_stop_loop_ends_the_loop(unit: Harness) -> None:
    unit.start_loop(3.9)
    values = unit.telemetry("LoopStatus")
    assert (values["Running"], values["Iterations"]) == (True, 4)
    unit.run(until_us=unit.now_us + 300_000)
    unit.command("StopLoop")
    unit.run(until_us=unit.now_us + 5_000_000)
    values = unit.telemetry("LoopStatus")  # the one under way was finished
    assert (values["Running"], values["Iterations"]) == (False, 5)


# --- image sensor ---------------------------------------------------------------------------------


@telecommand("Exposure", "SetFrameRate", "SetDiscardDelay", "SelectImageBank")
def test_camera_setting_telecommands_take_effect(unit: Harness) -> None:
    unit.command("Exposure", exposure=1000)
    unit.command("SetFrameRate", FrameRate=30)
    unit.command("SetDiscardDelay", Delay=20)
    unit.command("SelectImageBank", Bank=1)
    unit.shown("Exposure", exposure=1000)
    status = unit.telemetry("LoopStatus")
    assert (status["FrameRate"], status["DiscardDelay"], status["Bank"]) == (30, 20, 1)
    unit.command("CaptureImage")
    registers = ("EXPOSURE", "EXPOSURE_RULE", "FRAMES_PER_SECOND")
    assert [unit.camera_value(name) for name in registers] == [1000, 0, 30]
    assert unit.telemetry("PhaseTimes")["Discard"] == pytest.approx(20_000, abs=100)
    assert unit.pins["BANK"] == 1
    unit.command("Exposure", exposure=0)
    unit.command("CaptureImage")
    assert unit.camera_value("EXPOSURE_RULE") == 2


@telecommand("WriteTo_IS_Register", "ReadFrom_IS_Register", "SetCameraRegisterPage")
def test_paged_camera_register_telecommands_work(unit: Harness) -> None:
    unit.shown("IS_Register", DataH=0, DataL=0)
    unit.command("WriteTo_IS_Register", Reg=0x26, DataH=0, DataL=0x77)
    assert unit.camera == {0x8526: 0x77}
    unit.command("SetCameraRegisterPage", Page=0x81)
    assert unit.telemetry("LoopStatus")["CameraPage"] == 0x81
    unit.command("WriteTo_IS_Register", Reg=0x02, DataH=0, DataL=0x46)
    assert unit.camera == {0x8526: 0x77, 0x8102: 0x46}
    unit.command("ReadFrom_IS_Register", Reg=0x02)
    unit.shown("IS_Register", DataH=0, DataL=0x46)


@telecommand("WriteCameraRegister", "SelectCameraRegister")
def test_camera_register_telecommands_write_and_read(unit: Harness) -> None:
    unit.shown("CameraRegister", Address=0, Value=0, Valid=0)
    unit.command("WriteCameraRegister", Address=0x840B, Value=3)
    assert unit.camera == {0x840B: 3}
    unit.command("SelectCameraRegister", Address=0x840B)
    unit.shown("CameraRegister", Address=0x840B, Value=3, Valid=1)
    unit.camera_refuses = lambda _data: True
    unit.command("SelectCameraRegister", Address=0x851C)
    unit.shown("CameraRegister", Address=0x851C, Value=0, Valid=0)


# --- optics and picture ---------------------------------------------------------------------------


@telecommand("setFocalLength")
def test_set_focal_length_scales_the_body_vectors(unit: Harness, sky: Sky) -> None:
    before = first_vector(unit, sky)
    unit.command("setFocalLength", FocalLength=7.0)
    unit.shown("FocalLengthDetails", FocalLength=7.0, Fx=1147.5, Fy=1147.4)
    after = first_vector(unit, sky)
    assert after[1] / after[2] == pytest.approx(6.28 / 7 * before[1] / before[2], rel=1e-3)


@telecommand("setFocalLengthComponents")
def test_set_focal_length_components_changes_the_corrected_position(
    unit: Harness, sky: Sky
) -> None:
    before = first(unit, sky, *POINT)
    unit.command("setFocalLengthComponents", Fx=2000.0, Fy=2100.0)
    unit.shown("FocalLengthDetails", FocalLength=6.28, Fx=2000.0, Fy=2100.0)
    assert (first(unit, sky, *POINT) != before).all()


@telecommand("setPrincipalPoint")
def test_set_principal_point_shifts_the_body_vectors(unit: Harness, sky: Sky) -> None:
    before = first_vector(unit, sky)
    unit.command("setPrincipalPoint", Cx=512.0, Cy=256.0)
    unit.shown("PrincipalPoint", Cx=512.0, Cy=256.0)
    after = first_vector(unit, sky)
    assert after[0] > before[0]
    assert after[1] < before[1]


@telecommand("setRadialDistortionGains", "setTangentalDistortionGains")
def test_distortion_telecommands_change_the_corrected_position(unit: Harness, sky: Sky) -> None:
    unit.command("setTangentalDistortionGains", P1=0.5, P2=-0.25)
    unit.shown("DistortionCoef", K1=0.32358, K2=-0.12456, P1=0.5, P2=-0.25)
    assert first(unit, sky, *POINT) != pytest.approx(first(unit, sky, *CENTROID), abs=5)
    unit.command("setTangentalDistortionGains", P1=0.0, P2=0.0)
    unit.command("setRadialDistortionGains", K1=0.0, K2=0.0)
    unit.shown("DistortionCoef", K1=0.0, K2=0.0, P1=0.0, P2=0.0)
    assert first(unit, sky, *POINT) == pytest.approx(first(unit, sky, *CENTROID), abs=1e-3)


@telecommand("CaptureTestPatern")
def test_capture_test_pattern_stores_each_pattern(unit: Harness) -> None:
    y, x = np.mgrid[:512, :1024]
    for pattern, expected in (
        (cubestar.TestPattern.MOVING, x),
        (cubestar.TestPattern.MOVING, x + 1),
        (cubestar.TestPattern.FIXED, x + y),
        (cubestar.TestPattern.FIXED, x + y),
        (cubestar.TestPattern.RAMPING, x),
    ):
        unit.command("CaptureTestPatern", TestPaternType=pattern)
        assert np.array_equal(image(unit), expected % 256)
    unit.command("DetectStars")
    assert "StatusError" not in unit.flags()  # the pattern counts as a picture


@telecommand("CaptureImage")
def test_capture_image_stores_the_frame(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureImage")
    assert np.array_equal(image(unit), sky.picture)
    assert unit.status() is TaskStatus.CAPTURED
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 0


@telecommand("UploadImage", "UploadBlock")
def test_upload_telecommands_store_the_image(unit: Harness, sky: Sky) -> None:
    unit.command("UploadBlock", BlockNumber=3, Data=b"\x55" * 128)
    unit.command("UploadImage")
    assert not image(unit).any()
    unit.shown("UploadStatus", NextBlock=0, BlocksReceived=0)
    blocks = [(n, block) for n, block in enumerate(sky.picture.reshape(-1, 128)) if block.any()]
    for number, block in blocks:
        unit.command("UploadBlock", BlockNumber=number, Data=block.tobytes())
    assert np.array_equal(image(unit), sky.picture)
    unit.shown("UploadStatus", NextBlock=blocks[-1][0] + 1, BlocksReceived=len(blocks))
    unit.command("UploadBlock", BlockNumber=4095, Data=bytes(128))
    assert unit.telemetry("UploadStatus")["NextBlock"] == 4096
    unit.command("ProcessImage")
    assert unit.telemetry("AttitudeQuaternion")["Valid"]


@telecommand("ImageBlockSet")
def test_image_block_set_selects_block_and_size(unit: Harness) -> None:
    unit.command("CaptureTestPatern", TestPaternType=cubestar.TestPattern.RAMPING)
    for size, length in enumerate((32, 64, 128)):
        unit.command("ImageBlockSet", BlockNumber=5, BlockSize=size)
        block = unit.telemetry("ImageBlock")["Block"]
        expected = bytes(value % 256 for value in range(5 * length, 6 * length))
        assert block == expected.ljust(128, b"\0")
    unit.command("ImageBlockSet", BlockNumber=2047, BlockSize=3)
    reads = [unit.telemetry("ImageBlock")["Block"] for _ in range(3)]
    assert reads[0] + reads[1] == bytes(range(256))
    assert reads[2] == reads[0]
    unit.command("ImageBlockSet", BlockNumber=2047, BlockSize=3)
    assert unit.telemetry("ImageBlock")["Block"] == reads[0]  # the first half again


@telecommand("StreamDownImage")
def test_stream_down_image_sends_all_blocks(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureImage", "StreamDownImage")
    frames = unit.received()
    assert len(frames) == 4096
    assert b"".join(frames) == sky.picture.tobytes()


# --- stars and attitude ---------------------------------------------------------------------------


@telecommand("setDetectionRegion")
def test_set_detection_region_limits_the_search(unit: Harness, sky: Sky) -> None:
    region = {"StepSize": 2, "Xstart": 100, "Xend": 600, "Ystart": 50, "Yend": 400}
    unit.command("setDetectionRegion", **region)
    unit.shown("DetectionRegion", **region)
    first(unit, sky)
    inside = np.all((sky.pixels > (100, 50)) & (sky.pixels < (600, 400)), axis=1)
    assert 0 < inside.sum() < len(sky.stars)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == inside.sum()


@telecommand("setDetectionThresholds")
def test_set_detection_thresholds_changes_the_detected_stars(unit: Harness, sky: Sky) -> None:
    unit.command("setDetectionThresholds", DetectionThreshold=200, StarThreshold=9)
    values = unit.telemetry("DetectionThresholdValues")
    assert (values["DetectionThreshold"], values["StarThreshold"]) == (200, 9)
    first(unit, sky)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 0  # they peak at 150


@telecommand("setStarPixels")
def test_set_star_pixels_limits_the_star_size(unit: Harness, sky: Sky) -> None:
    unit.command("setStarPixels", MinPixels=99, MaxPixels=100)
    unit.shown("StarPixels", MinPixels=99, MaxPixels=100)
    first(unit, sky)
    summary = unit.telemetry("DetectionSummary")
    assert (summary["NumStarsDetected"], summary["AmountOfNoise"]) == (0, len(sky.stars))
    unit.command("setStarPixels", MinPixels=2, MaxPixels=9)
    first(unit, sky)
    assert unit.telemetry("DetectionSummary")["NumInvalidStars"] >= len(sky.stars)


@telecommand("setDetectionVariables")
def test_set_detection_variables_limits_the_star_count(unit: Harness, sky: Sky) -> None:
    limits = {"GridSize": 3, "MaxStars": 4, "MaxInvalidStars": 5, "MaxNoise": 6}
    unit.command("setDetectionVariables", **limits)
    unit.shown("StarGrid", GridSize=3)
    unit.shown("MaxStars", maxStars=4, maxInvalidStars=5, maxNoise=6)
    first(unit, sky)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 4


@telecommand("setIDMode")
def test_set_id_mode_changes_the_shown_mode(unit: Harness) -> None:
    for mode in (0, 1):
        unit.command("setIDMode", IdMode=mode)
        unit.shown("IDMode", Mode=mode)
        assert unit.telemetry("Results")["IDMode"] == mode


@telecommand("SetProfile", "SetSwitch")
def test_profile_and_switch_telecommands_take_effect_at_once(unit: Harness, sky: Sky) -> None:
    """They count at once, and a page is paid for from then on."""
    unit.picture = sky.picture
    unit.command("SetProfile", Profile="published")
    unit.command("CaptureAndProcess")
    assert unit.flash.writes["attitude"] == 1
    stored = unit.flash.read("attitude")
    for value, paid in (("NOTHING", False), ("PAGE", True)):
        unit.command("SetSwitch", Switch="FLASH_STORE", Value=value)
        before_us = unit.now_us
        unit.command("EstimateAttitude")
        assert (unit.now_us - before_us > 20_000) is paid
        assert (unit.flash.read("attitude") == stored) is paid  # the matrix is stored as well
    unit.command("MCUReset")
    assert unit.telemetry("Profile")["Profile"] == 0
    unit.command("Reset")
    assert unit.telemetry("Profile") == shown_values(unit.algorithms)


@telecommand("SetBody")
def test_set_body_lists_a_direction_at_its_place(unit: Harness) -> None:
    place = {"Number": 7, "RightAscension": 0.5, "Declination": 0.25, "Radius": 0.0045}
    unit.command("SetBody", **place, Accuracy=1e-4, Minutes=2)
    body = unit.program.state.bodies[7]
    expected = [np.cos(0.25) * np.cos(0.5), np.cos(0.25) * np.sin(0.5), np.sin(0.25)]
    np.testing.assert_allclose(body.direction, expected, atol=1e-7)
    assert body.until_s == unit.now_us // 1_000_000 + 120
    assert [one.until_s for one in unit.program.state.bodies[:7]] == [0] * 7


@telecommand("setTrackingMode")
def test_set_tracking_mode_selects_assisted_mode(unit: Harness) -> None:
    unit.command("setTrackingMode", RightAscension=1.0, Declination=-0.5)
    assert unit.telemetry("LoopStatus")["ModeFlag"] == cubestar.MatchMode.ASSISTED


@pytest.mark.parametrize("profile", ["extended"])  # as printed, stars without votes have names
@telecommand("setIDMargin")
def test_set_id_margin_makes_wrong_positions_fail(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMargin", Margin=0.0001)
    unit.shown("IDMargin", Margin=0.0001)
    unit.command("setRadialDistortionGains", K1=-0.3, K2=-0.12456)  # places are wrong by pixels
    first(unit, sky)
    unit.command("IDStars")
    assert unit.status() is TaskStatus.IDENTIFICATION_FAILED


@telecommand("DetectStars", "IDStars", "SelectBestStars", "EstimateAttitude")
def test_processing_step_telecommands_run_one_step_each(unit: Harness, sky: Sky) -> None:
    first(unit, sky)
    assert unit.status() is TaskStatus.DETECTED
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    unit.shown("NumIdStars", numIdStars=0)
    unit.command("IDStars")
    assert unit.status() is TaskStatus.IDENTIFIED
    unit.shown("NumIdStars", numIdStars=len(sky.stars))
    found = {unit.telemetry("IDStarsDetails")["Identity"] for _ in sky.stars}
    assert found == set(sky.stars)
    unit.shown("BestStarIndex", Star1Index=255, Star2Index=255, Star3Index=255)
    unit.command("SelectBestStars")
    assert len(set(unit.telemetry("BestStarIndex").values())) == 3
    magnitudes = [unit.telemetry(f"Star{n}Details")[f"S{n}Mag"] for n in (1, 2, 3)]
    assert magnitudes == sorted(magnitudes, reverse=True)  # all have as many votes
    assert not unit.telemetry("AttitudeQuaternion")["Valid"]
    unit.command("EstimateAttitude")
    assert unit.status() is TaskStatus.CALCULATED
    values = unit.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["Matched"]) == (True, len(sky.stars))


@telecommand("CaptureAndProcess", "ProcessImage")
def test_capture_and_process_yields_an_attitude(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")
    assert unit.status() is TaskStatus.CALCULATED
    values = unit.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (True, 1)
    unit.command("CaptureImage")
    unit.log.clear()
    unit.command("ProcessImage")
    assert not any(isinstance(what, SetPin) for _, what in unit.log)
    assert unit.status() is TaskStatus.CALCULATED
    unit.frame_us = None
    unit.command("CaptureAndProcess")
    assert unit.status() is TaskStatus.CAPTURE_FAILED
    values = unit.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (False, 2)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 0
