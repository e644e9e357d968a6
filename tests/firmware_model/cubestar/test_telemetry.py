import math

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS
from cubestack.firmware_model.cubestar.telemetry import NODE_TYPE, SETTINGS_SHOWN, TIMES_SHOWN
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import (
    INTERFACE,
    IdMode,
    MatchMode,
    ResetCause,
    TaskStatus,
)
from cubestack.firmware_model.node.state import FIRMWARE_VERSION, SERIAL_NUMBER
from tests.together import together

from ..registry import registered_in
from .harness import Harness
from .sky import Sky

CHECKS: dict[str, object] = {}

SUPPORTED = [message.name for message in INTERFACE.telemetries if message.supported]

#: Frames that other tests of this folder enumerate, by the test that does.
ELSEWHERE = {
    "Profile": "test_effects",
    "Quality": "test_quality",
    "StellarGyro": "test_gyro",
    "Bodies": "test_bodies",
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
        ("ErrorFlags", "TcmdProcessed", "SRAMTestResults", "IS_Register", "ImageBlock",
         "UploadStatus", "CameraRegister"),
        "test_effects",
    ),
    "PowerStatus": "test_supply",
    "SupplyReport": "test_supply",
    "CameraTiming": "test_image_sensor",
    "StartAndLoopTime": "test_program",
}  # fmt: skip


telemetry = registered_in(CHECKS)  #: Decorator: the test is of the named telemetry


def test_every_telemetry_frame_is_tested_once() -> None:
    assert sorted([*CHECKS, *ELSEWHERE, *SETTINGS_SHOWN, *TIMES_SHOWN]) == sorted(SUPPORTED)


def test_a_frame_that_is_not_supported_is_not_answered(unit: Harness) -> None:
    for message in INTERFACE.telemetries:
        answered = unit.uart(encode_frame(bytes([message.id]))) != []
        assert answered == message.supported


@pytest.mark.parametrize("name", SUPPORTED)
def test_telemetry_frames_are_complete_at_any_time(name: str, lit: Harness) -> None:
    message = INTERFACE.telemetry(name)

    def asked(_request: object = None) -> None:
        (answer,) = lit.uart(encode_frame(bytes([message.id])))
        assert len(answer) == message.length

    lit.on_request = asked
    lit.command("CaptureAndProcess")
    asked()


@telemetry("Identification")
def test_identification_reports_type_versions_and_runtime(unit: Harness) -> None:
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
def test_extended_identification_reports_resets_and_counters(unit: Harness) -> None:
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
def test_task_status_shows_the_steps_of_processing(lit: Harness) -> None:
    seen = []
    lit.on_request = lambda _request: seen.append(lit.telemetry("TaskStatus")["taskStatus"])
    lit.command("CaptureAndProcess")
    steps = [TaskStatus(value) for value in dict.fromkeys(seen)]
    assert steps == [  # between some of them no time passes
        TaskStatus.POWERED_UP,
        TaskStatus.CAMERA_INITIALISING,
        TaskStatus.CAMERA_INITIALISED,
        TaskStatus.CAPTURING,
        TaskStatus.DETECTING,
        TaskStatus.IDENTIFYING,
        TaskStatus.CALCULATING,
        TaskStatus.CALCULATED,
    ]
    assert lit.status() is TaskStatus.CALCULATED


@telemetry("LogStatus")
def test_log_status_reports_flags_temperature_and_runtime(unit: Harness) -> None:
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
        "Current": 60,
        "MaxCurrent": 60,
        "MinCurrent": 53,
    }


@telemetry("LoopStatus")
def test_loop_status_reports_settings_and_iterations(unit: Harness) -> None:
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
def test_image_setup_reports_size_and_first_line(unit: Harness) -> None:
    assert unit.telemetry("ImageSetup") == {"FirstLine": 0, "Width": 1024, "Height": 512}


@telemetry("PhaseTimes", "TimingSummary")
def test_phase_times_and_timing_summary_agree(lit: Harness) -> None:
    lit.command("CaptureAndProcess")
    phases = lit.telemetry("PhaseTimes")
    assert phases.pop("LoopTotal") == 0
    assert all(value > 0 for value in phases.values())
    values = lit.telemetry("TimingSummary")
    captured = phases["Discard"] + phases["Capture"] + phases["Transfer"]
    assert values["ImageCaptureTime"] == pytest.approx(captured / 1000, abs=0.5)
    assert values["DetectionTime"] == pytest.approx(phases["Detect"] / 1000, abs=0.5)
    assert values["IdentificationTime"] == pytest.approx(phases["Match"] / 1000, abs=0.5)
    assert values["DetectionTime"] > values["IdentificationTime"]


@telemetry("DetectionThresholdValues")
def test_detection_threshold_telemetry_shows_the_dark_level(unit: Harness) -> None:
    unit.command("setDetectionThresholds", DetectionThreshold=40, StarThreshold=30)
    values = {"DarkThreshold": 0, "DetectionThreshold": 40, "StarThreshold": 30}
    assert unit.telemetry("DetectionThresholdValues") == values
    unit.picture = np.full((512, 1024), 17, np.uint8)
    unit.command("CaptureAndProcess")
    assert unit.telemetry("DetectionThresholdValues") == values | {"DarkThreshold": 17}


def test_telemetry_counters_wrap_or_saturate(unit: Harness) -> None:
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


def test_telemetry_requests_do_not_change_telemetry(lit: Harness) -> None:
    lit.command("setIDMode", IdMode=IdMode.TRACKING)
    lit.command("CaptureAndProcess")
    steady = [
        name
        for name in SUPPORTED
        if not INTERFACE.telemetry(name).steps and name != "ExtendedIdentification"
    ]
    first = {name: lit.telemetry(name) for name in steady}
    assert first == {name: lit.telemetry(name) for name in steady}


# --- tables ---------------------------------------------------------------------------------------


@together("frame", SETTINGS_SHOWN | TIMES_SHOWN)
def test_every_field_of_a_settings_or_times_frame_is_tested(frame: str) -> None:
    shown = {**SETTINGS_SHOWN, **TIMES_SHOWN}[frame]
    assert list(shown) == [field.name for field in INTERFACE.telemetry(frame).fields]


@pytest.mark.parametrize("frame", SETTINGS_SHOWN)
def test_telemetry_shows_each_setting_with_its_default_type_and_unit(
    unit: Harness, frame: str
) -> None:
    values = unit.telemetry(frame)
    for field, (command, parameter) in SETTINGS_SHOWN[frame].items():
        assert command in SETTING_COMMANDS
        declared = INTERFACE.telecommand(command).field(parameter)
        assert values[field] == pytest.approx(float(declared.reset or 0), rel=1e-6)
        shown = INTERFACE.telemetry(frame).field(field)
        assert (shown.type, shown.scale, shown.unit) == (
            declared.type,
            declared.scale,
            declared.unit,
        )


def test_telemetry_shows_latest_and_longest_time_of_each_step(unit: Harness) -> None:
    processing = unit.program.commands.processing
    steps = sorted({step for shown in TIMES_SHOWN.values() for step in shown.values()})
    for number, step in enumerate(steps):
        processing.latest_ms[step] = 100.0 + number
        processing.longest_ms[step] = 200.0 + number
    for frame, shown in TIMES_SHOWN.items():
        values = unit.telemetry(frame)
        for field, step in shown.items():
            assert values[field] == steps.index(step) + (200 if "Max" in field else 100)


@pytest.mark.parametrize("profile", ["extended"])
def test_every_reported_step_time_is_measured(lit: Harness, sky: Sky) -> None:
    lit.command("CaptureAndProcess")
    lit.command("setIDMode", IdMode=IdMode.TRACKING)
    x, y, z = sky.attitude.inv().as_matrix()[:, 2]
    lit.command("setTrackingMode", RightAscension=math.atan2(y, x), Declination=math.asin(z))
    lit.command("CaptureAndProcess", "SelectBestStars")
    steps = {step for shown in TIMES_SHOWN.values() for step in shown.values()}
    assert steps <= lit.program.commands.processing.latest_ms.keys()
