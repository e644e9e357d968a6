import pytest

from ..sessions import Step, as_recorded
from .harness import Harness

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
def test_session(lit: Harness, profile: str) -> None:
    as_recorded(lit, f"CubeStar session, {profile}", STEPS)


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_loop(lit: Harness, profile: str) -> None:
    lit.start_loop(5.5)
    as_recorded(lit, f"CubeStar loop, {profile}", [])
