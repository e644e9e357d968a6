"""Every telecommand of the table, executed, and what it changed."""

from collections.abc import Callable

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.commands import STREAM_BACKLOG_BYTES, WATCHDOG_US
from cubestack.firmware_model.hardware import Pay, Request, SetPin, Sleep
from cubestack.firmware_model.interface.cubestar import (
    IMAGE_BYTES,
    INTERFACE,
    MatchMode,
    MemoryTest,
    ResetCause,
    TaskStatus,
    TestPattern,
)

from .bench import FRAME_US, Bench
from .sky import Sky

Effect = Callable[[Bench, Sky], None]
EFFECTS: dict[str, Effect] = {}


def telecommand(name: str) -> Callable[[Effect], Effect]:
    """The function shows what telecommand ``name`` does."""

    def register(effect: Effect) -> Effect:
        assert EFFECTS.setdefault(name, effect) is effect
        return effect

    return register


@pytest.mark.parametrize("name", [message.name for message in INTERFACE.telecommands])
def test_every_telecommand_does_what_it_says(name: str, bench: Bench, sky: Sky) -> None:
    EFFECTS[name](bench, sky)


def test_every_telecommand_has_an_effect_and_no_other_does(bench: Bench) -> None:
    declared = {message.name for message in INTERFACE.telecommands}
    assert bench.program.commands.handled == declared
    assert EFFECTS.keys() == declared


def image(bench: Bench) -> np.ndarray:
    return bench.external_ram[:IMAGE_BYTES].reshape(512, 1024)


def status(bench: Bench) -> TaskStatus:
    return TaskStatus(bench.telemetry("TaskStatus")["taskStatus"])


def shown(bench: Bench, frame: str, **values: float) -> None:
    assert bench.telemetry(frame) == pytest.approx(values, rel=1e-6)


# --- node ---------------------------------------------------------------------------------------


@telecommand("TogglePowerSW")
def toggle_power_sw(bench: Bench, _: Sky) -> None:
    bench.command("TogglePowerSW")
    assert bench.switches == {"memory": True, "imager": False}
    assert bench.telemetry("PowerStatus")["Status"] == 0
    bench.command("TogglePowerSW")
    assert bench.switches == {"memory": True, "imager": True}
    assert bench.telemetry("PowerStatus")["Status"] == 1
    bench.command("CaptureImage")
    assert status(bench) is TaskStatus.CAPTURED


@telecommand("Reset")
def reset(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=7)
    bench.command("SaveConfig")
    bench.command("Exposure", exposure=9)
    bench.command("SetDiscardDelay", Delay=1)
    bench.telemetry("IDMargin")
    bench.uart(b"noise")
    bench.command("TogglePowerSW")
    bench.command("Reset")
    assert bench.resets == [ResetCause.SYSTEM_REQUEST]
    assert bench.telemetry("ExtendedIdentification")["TcmdCount"] == 0
    assert bench.flags() == set()
    shown(bench, "Exposure", exposure=7)
    assert bench.telemetry("LoopStatus")["DiscardDelay"] == 70
    assert bench.switches["imager"]


@telecommand("MCUReset")
def mcu_reset(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=9)
    bench.command("TestSRAM")
    bench.command("MCUReset")
    assert bench.resets == [ResetCause.SYSTEM_REQUEST]
    shown(bench, "Exposure", exposure=9)
    assert bench.telemetry("SRAMTestResults")["TestResult"] == MemoryTest.NOT_RUN
    assert bench.telemetry("ExtendedIdentification")["TcmdCount"] == 3
    assert bench.telemetry("ExtendedIdentification")["ResetCause"] == ResetCause.SYSTEM_REQUEST


@telecommand("setDelayTimerTimeout")
def set_delay_timer_timeout(bench: Bench, _: Sky) -> None:
    bench.command("setDelayTimerTimeout", Time=0.4)
    shown(bench, "DelayTime", Timeout=0.4)
    start_us = bench.now_us
    bench.send("Trigger")
    bench.run(until_us=start_us + 3_000_000)
    enabled = [us for us, what in bench.log if what == SetPin("ENABLE", 1)]
    assert enabled[0] - start_us == pytest.approx(400_000 + 70_000, abs=5_000)


@telecommand("ClearWDGResetCounter")
def clear_wdg_reset_counter(bench: Bench, _: Sky) -> None:
    bench.command("TestWDG")
    bench.command("ClearWDGResetCounter")
    assert bench.telemetry("ExtendedIdentification")["WDGResetCount"] == 0
    assert bench.telemetry("LogStatus")["WDGcounter"] == 0


@telecommand("ClearErrorFlags")
def clear_error_flags(bench: Bench, _: Sky) -> None:
    bench.command("IDStars")
    assert bench.flags() == {"StatusError"}
    bench.command("ClearErrorFlags")
    assert bench.flags() == set()


# --- optics and sensor ----------------------------------------------------------------------------


@telecommand("Exposure")
def exposure(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=1000)
    shown(bench, "Exposure", exposure=1000)
    bench.command("CaptureImage")
    assert bench.camera_value("EXPOSURE") == 1000
    assert bench.camera_value("EXPOSURE_RULE") == 0
    bench.command("Exposure", exposure=0)
    bench.command("CaptureImage")
    assert bench.camera_value("EXPOSURE_RULE") == 2


@telecommand("setFocalLength")
def set_focal_length(bench: Bench, sky: Sky) -> None:
    bench.command("setFocalLength", FocalLength=12.0)
    shown(bench, "FocalLengthDetails", FocalLength=12.0, Fx=1147.5, Fy=1147.4)
    assert first_vector(bench, sky)[2] > 0.98  # half the field


@telecommand("setFocalLengthComponents")
def set_focal_length_components(bench: Bench, sky: Sky) -> None:
    before = first_point(bench, sky)
    bench.command("setFocalLengthComponents", Fx=2000.0, Fy=2100.0)
    shown(bench, "FocalLengthDetails", FocalLength=6.28, Fx=2000.0, Fy=2100.0)
    assert (first_point(bench, sky) != before).all()


@telecommand("setPrincipalPoint")
def set_principal_point(bench: Bench, sky: Sky) -> None:
    before = first_vector(bench, sky)
    bench.command("setPrincipalPoint", Cx=512.0, Cy=256.0)
    shown(bench, "PrincipalPoint", Cx=512.0, Cy=256.0)
    after = first_vector(bench, sky)
    assert after[0] > before[0]
    assert after[1] < before[1]


@telecommand("setRadialDistortionGains")
def set_radial_distortion_gains(bench: Bench, sky: Sky) -> None:
    bench.command("setTangentalDistortionGains", P1=0.0, P2=0.0)
    bench.command("setRadialDistortionGains", K1=0.0, K2=0.0)
    shown(bench, "DistortionCoef", K1=0.0, K2=0.0, P1=0.0, P2=0.0)
    assert first_point(bench, sky) == pytest.approx(first_centroid(bench, sky), abs=1e-3)


@telecommand("setTangentalDistortionGains")
def set_tangental_distortion_gains(bench: Bench, sky: Sky) -> None:
    bench.command("setTangentalDistortionGains", P1=0.5, P2=-0.25)
    shown(bench, "DistortionCoef", K1=0.32358, K2=-0.12456, P1=0.5, P2=-0.25)
    assert first_point(bench, sky) != pytest.approx(first_centroid(bench, sky), abs=5)


def first_position(bench: Bench, sky: Sky) -> dict[str, float]:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.command("DetectStars")
    return bench.telemetry("StarPositions")


def first_centroid(bench: Bench, sky: Sky) -> np.ndarray:
    values = first_position(bench, sky)
    return np.array([values["X_Coordinate"], values["Y_Coordinate"]])


def first_point(bench: Bench, sky: Sky) -> np.ndarray:
    values = first_position(bench, sky)
    return np.array([values["X_CorrectedCoordinate"], values["Y_CorrectedCoordinate"]])


def first_vector(bench: Bench, sky: Sky) -> np.ndarray:
    first_position(bench, sky)
    values = bench.telemetry("BodyUnitVectors")
    return np.array([values["VbX"], values["VbY"], values["VbZ"]])


@telecommand("WriteTo_IS_Register")
def write_to_is_register(bench: Bench, _: Sky) -> None:
    bench.command("WriteTo_IS_Register", Reg=0x26, DataH=0, DataL=0x77)
    assert bench.camera_writes[-1] == bytes([0x85, 0x26, 0x77])


@telecommand("ReadFrom_IS_Register")
def read_from_is_register(bench: Bench, _: Sky) -> None:
    bench.camera[0x8527] = 0x42
    bench.command("ReadFrom_IS_Register", Reg=0x27)
    shown(bench, "IS_Register", DataH=0, DataL=0x42)


@telecommand("SetCameraRegisterPage")
def set_camera_register_page(bench: Bench, _: Sky) -> None:
    bench.command("SetCameraRegisterPage", Page=0x81)
    assert bench.telemetry("LoopStatus")["CameraPage"] == 0x81
    bench.command("WriteTo_IS_Register", Reg=0x02, DataH=0, DataL=0x46)
    assert bench.camera == {0x8102: 0x46}
    bench.command("ReadFrom_IS_Register", Reg=0x02)
    shown(bench, "IS_Register", DataH=0, DataL=0x46)


@telecommand("WriteCameraRegister")
def write_camera_register(bench: Bench, _: Sky) -> None:
    bench.command("WriteCameraRegister", Address=0x840B, Value=3)
    assert bench.camera == {0x840B: 3}


@telecommand("SelectCameraRegister")
def select_camera_register(bench: Bench, _: Sky) -> None:
    bench.camera[0x851D] = 7
    bench.command("SelectCameraRegister", Address=0x851D)
    shown(bench, "CameraRegister", Address=0x851D, Value=7, Valid=1)
    bench.camera_refuses = lambda _data: True
    bench.command("SelectCameraRegister", Address=0x851C)
    shown(bench, "CameraRegister", Address=0x851C, Value=0, Valid=0)


@telecommand("SetFrameRate")
def set_frame_rate(bench: Bench, _: Sky) -> None:
    bench.command("SetFrameRate", FrameRate=30)
    assert bench.telemetry("LoopStatus")["FrameRate"] == 30
    bench.command("CaptureImage")
    assert bench.camera_value("FRAMES_PER_SECOND") == 30


@telecommand("SetDiscardDelay")
def set_discard_delay(bench: Bench, _: Sky) -> None:
    bench.command("SetDiscardDelay", Delay=20)
    assert bench.telemetry("LoopStatus")["DiscardDelay"] == 20
    bench.command("CaptureImage")
    assert bench.telemetry("PhaseTimes")["Discard"] == pytest.approx(20_000, abs=100)


@telecommand("SelectImageBank")
def select_image_bank(bench: Bench, _: Sky) -> None:
    bench.command("SelectImageBank", Bank=1)
    assert bench.telemetry("LoopStatus")["Bank"] == 1
    bench.command("CaptureImage")
    assert bench.pins["BANK"] == 1


# --- picture --------------------------------------------------------------------------------------


@telecommand("CaptureTestPatern")
def capture_test_patern(bench: Bench, _: Sky) -> None:
    y, x = np.mgrid[:512, :1024]
    for pattern, expected in (
        (TestPattern.COLUMN_RAMP, x),
        (TestPattern.ROW_RAMP, y),
        (TestPattern.DIAGONAL_RAMP, x + y),
    ):
        bench.command("CaptureTestPatern", TestPaternType=pattern)
        assert np.array_equal(image(bench), expected % 256)
    bench.command("DetectStars")
    assert "StatusError" not in bench.flags()  # the pattern counts as a picture


@telecommand("CaptureImage")
def capture_image(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    assert np.array_equal(image(bench), sky.picture)
    assert status(bench) is TaskStatus.CAPTURED
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0


@telecommand("UploadImage")
def upload_image(bench: Bench, _: Sky) -> None:
    bench.command("UploadBlock", BlockNumber=3, Data=b"\x55" * 128)
    bench.command("UploadImage")
    assert not image(bench).any()
    shown(bench, "UploadStatus", NextBlock=0, BlocksReceived=0)


@telecommand("UploadBlock")
def upload_block(bench: Bench, sky: Sky) -> None:
    bench.command("UploadImage")
    for number, block in enumerate(sky.picture.reshape(-1, 128)):
        if block.any():
            bench.command("UploadBlock", BlockNumber=number, Data=block.tobytes())
    assert np.array_equal(image(bench), sky.picture)
    bench.command("UploadBlock", BlockNumber=4095, Data=bytes(128))
    assert bench.telemetry("UploadStatus")["NextBlock"] == 4096
    bench.command("ProcessImage")
    assert bench.telemetry("AttitudeQuaternion")["Valid"]


@telecommand("ImageBlockSet")
def image_block_set(bench: Bench, _: Sky) -> None:
    bench.command("CaptureTestPatern", TestPaternType=TestPattern.COLUMN_RAMP)
    for size, length in enumerate((32, 64, 128)):
        bench.command("ImageBlockSet", BlockNumber=5, BlockSize=size)
        block = bench.telemetry("ImageBlock")["Block"]
        expected = bytes(value % 256 for value in range(5 * length, 6 * length))
        assert block == expected.ljust(128, b"\0")
    bench.command("ImageBlockSet", BlockNumber=2047, BlockSize=3)
    reads = [bench.telemetry("ImageBlock")["Block"] for _ in range(3)]
    assert reads[0] + reads[1] == bytes(range(256))
    assert reads[2] == reads[0]
    bench.command("ImageBlockSet", BlockNumber=2047, BlockSize=3)
    assert bench.telemetry("ImageBlock")["Block"] == reads[0]  # the first half again


@telecommand("StreamDownImage")
def stream_down_image(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.command("StreamDownImage")
    frames = bench.received()
    assert len(frames) == 4096
    assert b"".join(frames) == sky.picture.tobytes()


# --- stars ----------------------------------------------------------------------------------------


@telecommand("setDetectionRegion")
def set_detection_region(bench: Bench, sky: Sky) -> None:
    region = {"StepSize": 2, "Xstart": 100, "Xend": 600, "Ystart": 50, "Yend": 400}
    bench.command("setDetectionRegion", **region)
    shown(bench, "DetectionRegion", **region)
    first_position(bench, sky)
    inside = np.all((sky.pixels > (100, 50)) & (sky.pixels < (600, 400)), axis=1)
    assert 0 < inside.sum() < len(sky.stars)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == inside.sum()


@telecommand("setDetectionThresholds")
def set_detection_thresholds(bench: Bench, sky: Sky) -> None:
    bench.command("setDetectionThresholds", DetectionThreshold=200, StarThreshold=9)
    values = bench.telemetry("DetectionThresholdValues")
    assert (values["DetectionThreshold"], values["StarThreshold"]) == (200, 9)
    first_position(bench, sky)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0  # they peak at 150


@telecommand("setStarPixels")
def set_star_pixels(bench: Bench, sky: Sky) -> None:
    bench.command("setStarPixels", MinPixels=100, MaxPixels=200)
    shown(bench, "StarPixels", MinPixels=100, MaxPixels=200)
    first_position(bench, sky)
    summary = bench.telemetry("DetectionSummary")
    assert (summary["NumStarsDetected"], summary["AmountOfNoise"]) == (0, len(sky.stars))
    bench.command("setStarPixels", MinPixels=2, MaxPixels=9)
    first_position(bench, sky)
    assert bench.telemetry("DetectionSummary")["NumInvalidStars"] >= len(sky.stars)


@telecommand("setDetectionVariables")
def set_detection_variables(bench: Bench, sky: Sky) -> None:
    limits = {"GridSize": 3, "MaxStars": 4, "MaxInvalidStars": 5, "MaxNoise": 6}
    bench.command("setDetectionVariables", **limits)
    shown(bench, "StarGrid", GridSize=3)
    shown(bench, "MaxStars", maxStars=4, maxInvalidStars=5, maxNoise=6)
    first_position(bench, sky)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 4


@telecommand("DetectStars")
def detect_stars(bench: Bench, sky: Sky) -> None:
    first_position(bench, sky)
    assert status(bench) is TaskStatus.DETECTED
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    assert bench.telemetry("NumIdStars")["numIdStars"] == 0


@telecommand("setIDMode")
def set_id_mode(bench: Bench, _: Sky) -> None:
    for mode in (0, 1):
        bench.command("setIDMode", IdMode=mode)
        shown(bench, "IDMode", Mode=mode)
        assert bench.telemetry("Results")["IDMode"] == mode


@telecommand("setTrackingMode")
def set_tracking_mode(bench: Bench, _: Sky) -> None:
    bench.command("setTrackingMode", RightAscension=1.0, Declination=-0.5)
    assert bench.telemetry("LoopStatus")["ModeFlag"] == MatchMode.ASSISTED


@telecommand("setIDMargin")
def set_id_margin(bench: Bench, sky: Sky) -> None:
    bench.command("setIDMargin", Margin=0.0001)
    shown(bench, "IDMargin", Margin=0.0001)
    bench.command("setFocalLength", FocalLength=6.30)  # angles are wrong by 3 parts in 1000
    first_position(bench, sky)
    bench.command("IDStars")
    assert status(bench) is TaskStatus.IDENTIFICATION_FAILED


@telecommand("IDStars")
def id_stars(bench: Bench, sky: Sky) -> None:
    first_position(bench, sky)
    bench.command("IDStars")
    assert status(bench) is TaskStatus.IDENTIFIED
    count = bench.telemetry("NumIdStars")["numIdStars"]
    assert count == len(sky.stars)
    found = {bench.telemetry("IDStarsDetails")["Identity"] for _ in range(count)}
    assert found == set(sky.stars)


@telecommand("SelectBestStars")
def select_best_stars(bench: Bench, sky: Sky) -> None:
    first_position(bench, sky)
    bench.command("IDStars")
    shown(bench, "BestStarIndex", Star1Index=255, Star2Index=255, Star3Index=255)
    bench.command("SelectBestStars")
    chosen = bench.telemetry("BestStarIndex")
    assert len(set(chosen.values())) == 3
    magnitudes = [bench.telemetry(f"Star{n}Details")[f"S{n}Mag"] for n in (1, 2, 3)]
    assert magnitudes == sorted(magnitudes, reverse=True)  # all have as many votes


@telecommand("EstimateAttitude")
def estimate_attitude(bench: Bench, sky: Sky) -> None:
    first_position(bench, sky)
    bench.command("IDStars")
    assert not bench.telemetry("AttitudeQuaternion")["Valid"]
    bench.command("EstimateAttitude")
    assert status(bench) is TaskStatus.CALCULATED
    assert bench.telemetry("AttitudeQuaternion")["Valid"]
    assert bench.telemetry("AttitudeQuaternion")["Matched"] == len(sky.stars)


# --- configuration, tests and operation -----------------------------------------------------------


@telecommand("SaveConfig")
def save_config(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=5)
    bench.command("setPrincipalPoint", Cx=1.5, Cy=2.5)
    bench.command("SaveConfig")
    bench.power_on()
    shown(bench, "Exposure", exposure=5)
    shown(bench, "PrincipalPoint", Cx=1.5, Cy=2.5)


@telecommand("ReadConfig")
def read_config(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=5)
    bench.command("SaveConfig")
    bench.command("Exposure", exposure=6)
    bench.command("ReadConfig")
    shown(bench, "Exposure", exposure=5)


@telecommand("ClearConfig")
def clear_config(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=5)
    bench.command("SaveConfig")
    bench.command("ClearConfig")
    shown(bench, "Exposure", exposure=0)
    bench.command("Exposure", exposure=6)
    bench.power_on()
    shown(bench, "Exposure", exposure=0)


@telecommand("TestSRAM")
def sram_test(bench: Bench, _: Sky) -> None:
    bench.command("CaptureImage")
    bench.command("TestSRAM")
    shown(bench, "SRAMTestResults", TestResult=MemoryTest.PASSED)
    bench.command("DetectStars")
    assert "StatusError" in bench.flags()  # the picture is lost

    def stuck(request: Request) -> None:
        if isinstance(request, Pay):
            bench.external_ram[777_777] |= 0x10

    bench.on_request = stuck
    bench.command("TestSRAM")
    shown(bench, "SRAMTestResults", TestResult=MemoryTest.FAILED)


@telecommand("TestWDG")
def wdg_test(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=9)
    start_us = bench.now_us
    bench.send("TestWDG")
    bench.run(until_us=start_us + WATCHDOG_US // 2)
    assert bench.telemetry("TcmdProcessed") == {"Processed": 0}  # it hangs, but answers
    bench.run()
    assert bench.now_us - start_us == pytest.approx(WATCHDOG_US, rel=0.01)
    assert bench.resets == [ResetCause.WATCHDOG]
    values = bench.telemetry("ExtendedIdentification")
    assert values["ResetCause"] == ResetCause.WATCHDOG
    assert values["WDGResetCount"] == 1
    assert values["TlmCount"] == 1  # counted while it hung
    shown(bench, "Exposure", exposure=9)
    bench.command("TestWDG")
    assert bench.telemetry("LogStatus")["WDGcounter"] == 2


@telecommand("CaptureAndProcess")
def capture_and_process(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureAndProcess")
    assert status(bench) is TaskStatus.CALCULATED
    values = bench.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (True, 1)
    bench.frame_us = None
    bench.command("CaptureAndProcess")
    assert status(bench) is TaskStatus.CAPTURE_FAILED
    values = bench.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (False, 1)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0


@telecommand("ProcessImage")
def process_image(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.log.clear()
    bench.command("ProcessImage")
    assert not any(isinstance(what, SetPin) for _, what in bench.log)
    assert status(bench) is TaskStatus.CALCULATED


@telecommand("Trigger")
def trigger(bench: Bench, _: Sky) -> None:
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 3_900_000)
    values = bench.telemetry("LoopStatus")
    assert values["Running"]
    assert values["Iterations"] == 4


@telecommand("StopLoop")
def stop_loop(bench: Bench, _: Sky) -> None:
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 1_200_000)
    bench.command("StopLoop")
    assert bench.telemetry("LoopStatus")["Iterations"] == 2  # the one under way was finished
    assert not bench.telemetry("LoopStatus")["Running"]
    bench.run(until_us=bench.now_us + 5_000_000)
    assert bench.telemetry("LoopStatus")["Iterations"] == 2


# --- what they have in common ---------------------------------------------------------------------


def test_telecommands_are_executed_in_order(bench: Bench) -> None:
    for exposure in (1, 2, 3, 4):
        bench.send("Exposure", exposure=exposure)
    shown(bench, "Exposure", exposure=0)
    bench.run()
    shown(bench, "Exposure", exposure=4)


def test_processed_says_when_the_last_telecommand_is_done(bench: Bench) -> None:
    shown(bench, "TcmdProcessed", Processed=1)
    bench.send("CaptureImage")
    bench.send("Exposure", exposure=1)
    shown(bench, "TcmdProcessed", Processed=0)
    bench.run(until_us=bench.now_us + FRAME_US)
    shown(bench, "TcmdProcessed", Processed=0)
    bench.run()
    shown(bench, "TcmdProcessed", Processed=1)


@pytest.mark.parametrize("name", ["Reset", "MCUReset"])
def test_a_telecommand_that_resets_is_not_processed_before_the_reset(
    bench: Bench, name: str
) -> None:
    seen: dict[int, set[int]] = {0: set(), 1: set()}
    bench.on_request = lambda _request: seen[len(bench.resets)].add(
        bench.telemetry("TcmdProcessed")["Processed"]
    )
    bench.command(name)
    assert seen == {0: {0}, 1: {1}}


@pytest.mark.parametrize("name", ["Reset", "MCUReset", "TestWDG"])
def test_a_reset_drops_the_telecommands_that_wait(bench: Bench, name: str) -> None:
    bench.send(name)
    bench.send("Exposure", exposure=9)
    bench.run()
    shown(bench, "Exposure", exposure=0)


def test_the_stream_waits_for_the_uart(bench: Bench) -> None:
    bench.command("UploadImage")
    bench.backlog = STREAM_BACKLOG_BYTES + 1
    start_us = bench.now_us
    bench.send("StreamDownImage")
    bench.run(until_us=start_us + 1_000_000)
    assert bench.received() == []
    bench.backlog = STREAM_BACKLOG_BYTES
    bench.run()
    assert len(bench.received()) == 4096


def test_a_hang_is_not_ended_by_an_interrupt(bench: Bench) -> None:
    sleeps = []
    bench.on_request = lambda request: (
        sleeps.append(request) if isinstance(request, Sleep) else None
    )
    bench.send("TestWDG")
    bench.send("Exposure", exposure=1)  # wakes
    bench.run()
    assert not sleeps[0].wakeable


def test_a_configuration_survives_the_power_cycle_and_nothing_else_does(bench: Bench) -> None:
    bench.command("setIDMargin", Margin=0.002)
    bench.command("SaveConfig")
    bench.command("setIDMargin", Margin=0.003)
    bench.command("IDStars")
    bench.command("TestWDG")
    bench.power_on()
    shown(bench, "IDMargin", Margin=0.002)
    assert bench.flags() == set()
    values = bench.telemetry("ExtendedIdentification")
    assert (values["WDGResetCount"], values["TcmdCount"]) == (0, 0)
    assert values["ResetCause"] == ResetCause.POWER_ON
