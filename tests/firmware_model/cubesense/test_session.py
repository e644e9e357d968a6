import pytest

from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches

from ..sessions import Step, as_recorded
from .harness import Harness
from .test_commands import lit

STEPS: list[Step] = [
    ("CaptureAndDetect", {"Camera": 0, "Sram": 0}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
    ("CaptureAndDetect", {"Camera": 0, "Sram": 1}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 0}),
    ("SetNadirSearch", {"Search": 1}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
    ("CaptureOnly", {"Camera": 0, "Sram": 0, "Location": 0}),
    ("StartImageDownload", {"Sram": 0, "Location": 0, "Size": 3}),
    ("NextImageFrame", {"Frame": 1}),
    ("DetectionThreshold1", {"Threshold": 240}),
    ("DetectionThreshold2", {"Threshold": 90}),
    ("CameraSettings1", {"Exposure": 20, "Gain": 4}),
    ("CameraSettings2", {}),
    ("AutoAdjust1", {"Enabled": 1}),
    ("Boresight1", {"X": 370, "Y": 255}),
    ("Mask1", {"Area": 1, "XMin": 10, "XMax": 20, "YMin": 30, "YMax": 40}),
    ("Distortion1", {}),
    ("CaptureAndDetect", {"Camera": 0, "Sram": 0}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
    ("ClearOverCurrent", {}),
    ("Reset", {}),
    ("CaptureAndDetect", {"Camera": 1, "Sram": 1}),
]


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_session(unit: Harness, profile: str) -> None:
    lit(unit)
    as_recorded(unit, f"CubeSense session, {profile}", STEPS)


def test_session_of_addressed_pixels() -> None:
    unit = Harness(CubeSenseSwitches.of("extended"), mcu_addressing=True)
    lit(unit)
    as_recorded(unit, "CubeSense session, addressed", STEPS[4:8])
