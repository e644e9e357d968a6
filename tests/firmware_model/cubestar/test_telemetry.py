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
    ResetCause,
    TaskStatus,
)
from cubestack.firmware_model.node.identification import FIRMWARE_VERSION, SERIAL_NUMBER

from ..registry import registered_in
from .harness import FRAME_US, Harness
from .sky import Sky

Check = Callable[[Harness, Sky], None]
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
    **dict.fromkeys(
        ("ErrorFlags", "TcmdProcessed", "SRAMTestResults", "IS_Register", "ImageBlock",
         "UploadStatus"),
        "test_commands",
    ),
    "PowerStatus": "test_supply",
    "CameraTiming": "test_image_sensor",
}  # fmt: skip


#: Decorator: the function checks the named telemetry.
telemetry = registered_in(CHECKS)


@pytest.mark.parametrize("name", [name for name in SUPPORTED if name not in ELSEWHERE])
def test_every_frame_shows_the_state(name: str, unit: Harness, sky: Sky) -> None:
    CHECKS[name](unit, sky)


def test_every_frame_is_tested_once() -> None:
    assert sorted([*CHECKS, *ELSEWHERE]) == sorted(SUPPORTED)


def test_a_frame_that_is_not_supported_is_not_answered(unit: Harness) -> None:
    for message in INTERFACE.telemetries:
        answered = unit.uart(encode_frame(bytes([message.id]))) != []
        assert answered == message.supported


@pytest.mark.parametrize("name", SUPPORTED)
def test_every_frame_is_whole_at_any_time(name: str, unit: Harness, sky: Sky) -> None:
    message = INTERFACE.telemetry(name)

    def asked() -> None:
        (answer,) = unit.uart(encode_frame(bytes([message.id])))
        assert len(answer) == message.length

    unit.picture = sky.picture
    unit.on_request = lambda _request: asked()
    unit.command("CaptureAndProcess")
    asked()


@telemetry("Identification")
def identification(unit: Harness, _: Sky) -> None:
    unit.now_us = 65_536_000_000 + 7_654_321
    values = unit.telemetry("Identification")
    assert values == {
        "NodeType": NODE_TYPE,
        "InterfaceVersion": 3,
        "FirmwareVersionMajor": FIRMWARE_VERSION[0],
        "FirmwareVersionMinor": FIRMWARE_VERSION[1],
        "RuntimeMilliseconds": 654,
        "RuntimeSeconds": 7,
    }


@telemetry("ExtendedIdentification")
def extended_identification(unit: Harness, _: Sky) -> None:
    unit.command("TestWDG", "Exposure")
    unit.telemetry("IDMode")
    assert unit.telemetry("ExtendedIdentification") == {
        "SerialNumber": SERIAL_NUMBER,
        "Temperature": 21.5,
        "ResetCause": ResetCause.WATCHDOG,
        "WDGResetCount": 1,
        "TcmdCount": 2,
        "TlmCount": 1,
    }


@telemetry("TaskStatus")
def task_status(unit: Harness, sky: Sky) -> None:
    seen = []
    unit.picture = sky.picture
    unit.on_request = lambda _request: seen.append(unit.telemetry("TaskStatus")["taskStatus"])
    unit.command("CaptureAndProcess")
    steps = [TaskStatus(value) for value in dict.fromkeys(seen)]
    assert steps == [  # between some of them no time passes
        TaskStatus.POWERED_UP,
        TaskStatus.CAPTURING,
        TaskStatus.DETECTING,
        TaskStatus.IDENTIFYING,
        TaskStatus.CALCULATING,
        TaskStatus.CALCULATED,
    ]
    assert unit.telemetry("TaskStatus")["taskStatus"] == TaskStatus.CALCULATED


@telemetry("StartAndLoopTime")
def start_and_loop_time(unit: Harness, _: Sky) -> None:
    assert unit.telemetry("StartAndLoopTime") == {
        "StartupTime": Harness.boot_us // 1000,
        "LoopTime": 0,
        "MaxLoopTime": 0,
    }
    unit.start_loop(1.9)
    times = unit.telemetry("StartAndLoopTime")
    assert times["LoopTime"] == pytest.approx(70 + FRAME_US / 1000 + 404, abs=3)
    assert times["MaxLoopTime"] > times["LoopTime"]


@telemetry("LogStatus")
def log_status(unit: Harness, _: Sky) -> None:
    unit.command("TestWDG", "IDStars")
    unit.now_us = 99_999 * 1_000_000
    unit.currents["imager"] = 60.1
    values = unit.telemetry("LogStatus")
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
def supply_report(unit: Harness, _: Sky) -> None:
    unit.program.supply.overcurrent("imager")
    unit.run()
    unit.program.supply.overcurrent("imager")
    assert unit.telemetry("SupplyReport") == {
        "SramCurrent": 2.0,
        "ImagerCurrent": 0.0,
        "LatchUps": 2,
        "PowerCycles": 1,
    }


@telemetry("LoopStatus")
def loop_status(unit: Harness, _: Sky) -> None:
    unit.command("setTrackingMode", RightAscension=0.0, Declination=0.0)
    unit.command("SetFrameRate", FrameRate=9)
    unit.command("SetDiscardDelay", Delay=71)
    unit.command("SelectImageBank", Bank=1)
    unit.command("SetCameraRegisterPage", Page=0x84)
    unit.start_loop(1.9)
    assert unit.telemetry("LoopStatus") == {
        "Iterations": 2,
        "ModeFlag": MatchMode.ASSISTED,
        "FrameRate": 9,
        "DiscardDelay": 71,
        "Bank": 1,
        "CameraPage": 0x84,
        "Running": True,
    }


@telemetry("ImageSetup")
def image_setup(unit: Harness, _: Sky) -> None:
    assert unit.telemetry("ImageSetup") == {"FirstLine": 0, "Width": 1024, "Height": 512}


@telemetry("CameraRegister")
def camera_register(unit: Harness, _: Sky) -> None:
    assert unit.telemetry("CameraRegister") == {"Address": 0, "Value": 0, "Valid": 0}
    unit.camera[0x8511] = 0xC3
    unit.command("ReadFrom_IS_Register", Reg=0x11)
    assert unit.telemetry("CameraRegister") == {"Address": 0x8511, "Value": 0xC3, "Valid": 1}


@telemetry("TimingSummary")
def timing_summary(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")
    phases = unit.telemetry("PhaseTimes")
    values = unit.telemetry("TimingSummary")
    captured = phases["Discard"] + phases["Capture"] + phases["Transfer"]
    assert values["ImageCaptureTime"] == pytest.approx(captured / 1000, abs=0.5)
    assert values["DetectionTime"] == pytest.approx(phases["Detect"] / 1000, abs=0.5)
    assert values["IdentificationTime"] == pytest.approx(phases["Match"] / 1000, abs=0.5)
    assert values["DetectionTime"] > values["IdentificationTime"] > 0


@telemetry("PhaseTimes")
def phase_times(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.run(until_us=unit.now_us + 250_000)
    unit.command("CaptureAndProcess")
    values = unit.telemetry("PhaseTimes")
    assert values["Idle"] == pytest.approx(250_000 + Harness.boot_us, abs=100)
    assert all(value > 0 for name, value in values.items() if name != "LoopTotal")
    assert values["LoopTotal"] == 0


@telemetry("DetectionThresholdValues")
def thresholds(unit: Harness, _: Sky) -> None:
    unit.command("setDetectionThresholds", DetectionThreshold=40, StarThreshold=30)
    values = {"DarkThreshold": 0, "DetectionThreshold": 40, "StarThreshold": 30}
    assert unit.telemetry("DetectionThresholdValues") == values
    unit.picture = np.full((512, 1024), 17, np.uint8)
    unit.command("CaptureAndProcess")
    assert unit.telemetry("DetectionThresholdValues") == values | {"DarkThreshold": 17}


def test_counters_wrap_or_saturate_on_the_wire(unit: Harness) -> None:
    retained = unit.program.commands.state.retained
    retained.telecommands = retained.telemetry = 65_536 + 5
    retained.watchdog_resets = retained.latch_ups = 70_000
    retained.iterations = 2**40
    retained.longest_loop_us = 10**9
    values = unit.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["TlmCount"]) == (5, 5)
    assert values["WDGResetCount"] == 65_535
    assert unit.telemetry("SupplyReport")["LatchUps"] == 65_535
    assert unit.telemetry("LoopStatus")["Iterations"] == 2**32 - 1
    assert unit.telemetry("StartAndLoopTime")["MaxLoopTime"] == 65_535


def test_asking_changes_nothing_but_the_count_of_requests(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")
    steady = [
        name
        for name in SUPPORTED
        if not INTERFACE.telemetry(name).steps and name != "ExtendedIdentification"
    ]
    first = {name: unit.telemetry(name) for name in steady}
    assert first == {name: unit.telemetry(name) for name in steady}
