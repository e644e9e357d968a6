"""Every telemetry frame shows the state that it declares to show."""

from collections.abc import Callable

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.telemetry import NODE_TYPE
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import (
    INTERFACE,
    IdMode,
    MatchMode,
    MemoryTest,
    ResetCause,
    TaskStatus,
)
from cubestack.firmware_model.node.identification import FIRMWARE_VERSION, SERIAL_NUMBER

from .bench import BOOT_US, FRAME_US, Bench
from .sky import Sky

Check = Callable[[Bench, Sky], None]
CHECKS: dict[str, Check] = {}

SUPPORTED = [message.name for message in INTERFACE.telemetries if message.supported]

#: Frames that other tests of this folder enumerate, by the test that does.
ELSEWHERE = {
    **dict.fromkeys(
        ("StarPositions", "BodyUnitVectors", "IDStarsDetails", "InertialUnitVectors", "NumIdStars",
         "StarDetails", "HipparcosNumber", "DetectionSummary", "BestStarIndex", "Star1Details",
         "Star2Details", "Star3Details", "MatchSummary"),
        "test_star_reports",
    ),
    **dict.fromkeys(
        ("Quaternion", "SphereicalCoordinates", "AttitudeData", "AttitudeQuaternion",
         "PerformanceParameters", "Results"),
        "test_attitude_reports",
    ),
    **dict.fromkeys(
        ("Exposure", "FocalLengthDetails", "PrincipalPoint", "DistortionCoef", "DetectionRegion",
         "StarPixels", "StarGrid", "MaxStars", "IDMode", "IDMargin", "DelayTime",
         "DetectionTimingOne", "DetectionTimingTwo", "IDTimingOne", "IDTimingTwo",
         "IDTimingThree", "BestStarSelectionTime", "AttitudeTiming"),
        "test_telemetry_tables",
    ),
}  # fmt: skip


def telemetry(name: str) -> Callable[[Check], Check]:
    """The function checks telemetry ``name``."""

    def register(check: Check) -> Check:
        assert CHECKS.setdefault(name, check) is check
        return check

    return register


@pytest.mark.parametrize("name", [name for name in SUPPORTED if name not in ELSEWHERE])
def test_every_frame_shows_the_state(name: str, bench: Bench, sky: Sky) -> None:
    CHECKS[name](bench, sky)


def test_every_frame_is_tested_once() -> None:
    assert sorted([*CHECKS, *ELSEWHERE]) == sorted(SUPPORTED)


def test_a_frame_that_is_not_supported_is_not_answered(bench: Bench) -> None:
    for message in INTERFACE.telemetries:
        answered = bench.uart(encode_frame(bytes([message.id]))) != []
        assert answered == message.supported


@pytest.mark.parametrize("name", SUPPORTED)
def test_every_frame_is_whole_at_any_time(name: str, bench: Bench, sky: Sky) -> None:
    message = INTERFACE.telemetry(name)

    def asked() -> None:
        (answer,) = bench.uart(encode_frame(bytes([message.id])))
        assert len(answer) == message.length

    bench.picture = sky.picture
    bench.on_request = lambda _request: asked()
    bench.send("CaptureAndProcess")
    bench.run()
    asked()


# --- node -----------------------------------------------------------------------------------------


@telemetry("Identification")
def identification(bench: Bench, _: Sky) -> None:
    bench.now_us = 65_536_000_000 + 7_654_321
    values = bench.telemetry("Identification")
    assert values == {
        "NodeType": NODE_TYPE,
        "InterfaceVersion": 3,
        "FirmwareVersionMajor": FIRMWARE_VERSION[0],
        "FirmwareVersionMinor": FIRMWARE_VERSION[1],
        "RuntimeMilliseconds": 654,
        "RuntimeSeconds": 7,
    }


@telemetry("ExtendedIdentification")
def extended_identification(bench: Bench, _: Sky) -> None:
    bench.command("TestWDG")
    bench.command("Exposure")
    bench.telemetry("IDMode")
    assert bench.telemetry("ExtendedIdentification") == {
        "SerialNumber": SERIAL_NUMBER,
        "Temperature": 21.5,
        "ResetCause": ResetCause.WATCHDOG,
        "WDGResetCount": 1,
        "TcmdCount": 2,
        "TlmCount": 1,
    }


@telemetry("ErrorFlags")
def error_flags(bench: Bench, _: Sky) -> None:
    assert not any(bench.telemetry("ErrorFlags").values())
    bench.command("IDStars")
    bench.uart(b"noise")
    raised = {name for name, up in bench.telemetry("ErrorFlags").items() if up}
    assert raised == {"StatusError", "UART_ProtocolError"}


@telemetry("TcmdProcessed")
def processed(bench: Bench, _: Sky) -> None:
    bench.send("Exposure")
    assert bench.telemetry("TcmdProcessed") == {"Processed": 0}
    bench.run()
    assert bench.telemetry("TcmdProcessed") == {"Processed": 1}


@telemetry("TaskStatus")
def task_status(bench: Bench, sky: Sky) -> None:
    seen = []
    bench.picture = sky.picture
    bench.on_request = lambda _request: seen.append(bench.telemetry("TaskStatus")["taskStatus"])
    bench.send("CaptureAndProcess")
    bench.run()
    steps = [TaskStatus(value) for value in dict.fromkeys(seen)]
    assert steps == [  # between some of them no time passes
        TaskStatus.POWERED_UP,
        TaskStatus.CAPTURING,
        TaskStatus.DETECTING,
        TaskStatus.IDENTIFYING,
        TaskStatus.CALCULATING,
        TaskStatus.CALCULATED,
    ]
    assert bench.telemetry("TaskStatus")["taskStatus"] == TaskStatus.CALCULATED


@telemetry("StartAndLoopTime")
def start_and_loop_time(bench: Bench, _: Sky) -> None:
    assert bench.telemetry("StartAndLoopTime") == {
        "StartupTime": BOOT_US // 1000,
        "LoopTime": 0,
        "MaxLoopTime": 0,
    }
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 1_900_000)
    times = bench.telemetry("StartAndLoopTime")
    assert times["LoopTime"] == pytest.approx(70 + FRAME_US / 1000 + 404, abs=3)
    assert times["MaxLoopTime"] > times["LoopTime"]


@telemetry("SRAMTestResults")
def memory_test(bench: Bench, _: Sky) -> None:
    assert bench.telemetry("SRAMTestResults") == {"TestResult": MemoryTest.NOT_RUN}
    bench.command("TestSRAM")
    assert bench.telemetry("SRAMTestResults") == {"TestResult": MemoryTest.PASSED}


@telemetry("PowerStatus")
def power_status(bench: Bench, _: Sky) -> None:
    bench.currents["imager"] = 71.2
    currents = {"Current": 71.2, "MaxCurrent": 71.2, "MinCurrent": 52.8}
    assert bench.telemetry("PowerStatus") == {"Status": 1, **currents}


@telemetry("LogStatus")
def log_status(bench: Bench, _: Sky) -> None:
    bench.command("TestWDG")
    bench.command("IDStars")
    bench.now_us = 99_999 * 1_000_000
    bench.currents["imager"] = 60.1
    values = bench.telemetry("LogStatus")
    assert {name for name, value in values.items() if value is True} == {"StatusError"}
    assert {name: value for name, value in values.items() if not isinstance(value, bool)} == {
        "Temp": 21.5,
        "Runtime": 99_999,
        "WDGcounter": 1,
        "Status": TaskStatus.IDENTIFICATION_FAILED,
        "SW": 1,
        "Current": 60.1,
        "MaxCurrent": 60.1,
        "MinCurrent": 52.8,
    }


@telemetry("SupplyReport")
def supply_report(bench: Bench, _: Sky) -> None:
    bench.program.supply.overcurrent("imager")
    bench.run()
    bench.program.supply.overcurrent("imager")
    assert bench.telemetry("SupplyReport") == {
        "SramCurrent": 2.0,
        "ImagerCurrent": 0.0,
        "LatchUps": 2,
        "PowerCycles": 1,
    }


@telemetry("LoopStatus")
def loop_status(bench: Bench, _: Sky) -> None:
    bench.command("setTrackingMode", RightAscension=0.0, Declination=0.0)
    bench.command("SetFrameRate", FrameRate=9)
    bench.command("SetDiscardDelay", Delay=71)
    bench.command("SelectImageBank", Bank=1)
    bench.command("SetCameraRegisterPage", Page=0x84)
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 1_900_000)
    assert bench.telemetry("LoopStatus") == {
        "Iterations": 2,
        "ModeFlag": MatchMode.ASSISTED,
        "FrameRate": 9,
        "DiscardDelay": 71,
        "Bank": 1,
        "CameraPage": 0x84,
        "Running": True,
    }


# --- camera and picture ---------------------------------------------------------------------------


@telemetry("ImageSetup")
def image_setup(bench: Bench, _: Sky) -> None:
    assert bench.telemetry("ImageSetup") == {"FirstLine": 0, "Width": 1024, "Height": 512}


@telemetry("IS_Register")
def sensor_register(bench: Bench, _: Sky) -> None:
    assert bench.telemetry("IS_Register") == {"DataH": 0, "DataL": 0}
    bench.camera[0x8511] = 0xC3
    bench.command("ReadFrom_IS_Register", Reg=0x11)
    assert bench.telemetry("IS_Register") == {"DataH": 0, "DataL": 0xC3}


@telemetry("CameraRegister")
def camera_register(bench: Bench, _: Sky) -> None:
    assert bench.telemetry("CameraRegister") == {"Address": 0, "Value": 0, "Valid": 0}
    bench.camera[0x8511] = 0xC3
    bench.command("ReadFrom_IS_Register", Reg=0x11)
    assert bench.telemetry("CameraRegister") == {"Address": 0x8511, "Value": 0xC3, "Valid": 1}


@telemetry("ImageBlock")
def image_block(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    lit = int(np.flatnonzero(sky.picture)[0]) // 128
    bench.command("ImageBlockSet", BlockNumber=lit, BlockSize=2)
    expected = sky.picture.reshape(-1, 128)[lit].tobytes()
    assert any(expected)
    assert bench.telemetry("ImageBlock") == {"Block": expected}


@telemetry("UploadStatus")
def upload_status(bench: Bench, _: Sky) -> None:
    bench.command("UploadImage")
    for number in (7, 9, 9):
        bench.command("UploadBlock", BlockNumber=number, Data=bytes(128))
    assert bench.telemetry("UploadStatus") == {"NextBlock": 10, "BlocksReceived": 3}


@telemetry("CameraTiming")
def camera_timing(bench: Bench, _: Sky) -> None:
    assert not any(bench.telemetry("CameraTiming").values())
    bench.command("CaptureImage")
    values = bench.telemetry("CameraTiming")
    assert values["SetupTime"] > values["ExposureUpdateTime"] >= 1
    assert values["CaptureTime"] == 70 + FRAME_US // 1000


@telemetry("TimingSummary")
def timing_summary(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureAndProcess")
    phases = bench.telemetry("PhaseTimes")
    values = bench.telemetry("TimingSummary")
    captured = phases["Discard"] + phases["Capture"] + phases["Transfer"]
    assert values["ImageCaptureTime"] == pytest.approx(captured / 1000, abs=0.5)
    assert values["DetectionTime"] == pytest.approx(phases["Detect"] / 1000, abs=0.5)
    assert values["IdentificationTime"] == pytest.approx(phases["Match"] / 1000, abs=0.5)
    assert values["DetectionTime"] > values["IdentificationTime"] > 0


@telemetry("PhaseTimes")
def phase_times(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.run(until_us=bench.now_us + 250_000)
    bench.command("CaptureAndProcess")
    values = bench.telemetry("PhaseTimes")
    assert values["Idle"] == pytest.approx(250_000 + BOOT_US, abs=100)
    assert all(value > 0 for name, value in values.items() if name != "LoopTotal")
    assert values["LoopTotal"] == 0


@telemetry("DetectionThresholdValues")
def thresholds(bench: Bench, _: Sky) -> None:
    bench.command("setDetectionThresholds", DetectionThreshold=40, StarThreshold=30)
    values = {"DarkThreshold": 0, "DetectionThreshold": 40, "StarThreshold": 30}
    assert bench.telemetry("DetectionThresholdValues") == values
    bench.picture = np.full((512, 1024), 17, np.uint8)
    bench.command("CaptureAndProcess")
    assert bench.telemetry("DetectionThresholdValues") == values | {"DarkThreshold": 17}


# --- ends of ranges -------------------------------------------------------------------------------


def test_counters_wrap_or_saturate_on_the_wire(bench: Bench) -> None:
    retained = bench.program.commands._state.retained
    retained.telecommands = retained.telemetry = 65_536 + 5
    retained.watchdog_resets = retained.latch_ups = 70_000
    retained.iterations = 2**40
    retained.longest_loop_us = 10**9
    values = bench.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["TlmCount"]) == (5, 5)
    assert values["WDGResetCount"] == 65_535
    assert bench.telemetry("SupplyReport")["LatchUps"] == 65_535
    assert bench.telemetry("LoopStatus")["Iterations"] == 2**32 - 1
    assert bench.telemetry("StartAndLoopTime")["MaxLoopTime"] == 65_535


def test_asking_changes_nothing_but_the_count_of_requests(bench: Bench, sky: Sky) -> None:
    bench.command("setIDMode", IdMode=IdMode.TRACKING)
    bench.picture = sky.picture
    bench.command("CaptureAndProcess")
    steady = [
        name
        for name in SUPPORTED
        if not INTERFACE.telemetry(name).steps and name != "ExtendedIdentification"
    ]
    first = {name: bench.telemetry(name) for name in steady}
    assert first == {name: bench.telemetry(name) for name in steady}
