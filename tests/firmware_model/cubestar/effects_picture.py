"""Effects of telecommands: optics, picture, stars, attitude."""

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubestar import (
    IMAGE_BYTES,
    MatchMode,
    TaskStatus,
    TestPattern,
)

from .effects import shown, telecommand
from .harness import Harness
from .sky import Sky


def image(unit: Harness) -> np.ndarray:
    return unit.external_ram[:IMAGE_BYTES].reshape(512, 1024)


@telecommand("setFocalLength")
def set_focal_length(unit: Harness, sky: Sky) -> None:
    unit.command("setFocalLength", FocalLength=12.0)
    shown(unit, "FocalLengthDetails", FocalLength=12.0, Fx=1147.5, Fy=1147.4)
    assert first_vector(unit, sky)[2] > 0.98  # half the field


@telecommand("setFocalLengthComponents")
def set_focal_length_components(unit: Harness, sky: Sky) -> None:
    before = first_point(unit, sky)
    unit.command("setFocalLengthComponents", Fx=2000.0, Fy=2100.0)
    shown(unit, "FocalLengthDetails", FocalLength=6.28, Fx=2000.0, Fy=2100.0)
    assert (first_point(unit, sky) != before).all()


@telecommand("setPrincipalPoint")
def set_principal_point(unit: Harness, sky: Sky) -> None:
    before = first_vector(unit, sky)
    unit.command("setPrincipalPoint", Cx=512.0, Cy=256.0)
    shown(unit, "PrincipalPoint", Cx=512.0, Cy=256.0)
    after = first_vector(unit, sky)
    assert after[0] > before[0]
    assert after[1] < before[1]


@telecommand("setRadialDistortionGains")
def set_radial_distortion_gains(unit: Harness, sky: Sky) -> None:
    unit.command("setTangentalDistortionGains", P1=0.0, P2=0.0)
    unit.command("setRadialDistortionGains", K1=0.0, K2=0.0)
    shown(unit, "DistortionCoef", K1=0.0, K2=0.0, P1=0.0, P2=0.0)
    assert first_point(unit, sky) == pytest.approx(first_centroid(unit, sky), abs=1e-3)


@telecommand("setTangentalDistortionGains")
def set_tangental_distortion_gains(unit: Harness, sky: Sky) -> None:
    unit.command("setTangentalDistortionGains", P1=0.5, P2=-0.25)
    shown(unit, "DistortionCoef", K1=0.32358, K2=-0.12456, P1=0.5, P2=-0.25)
    assert first_point(unit, sky) != pytest.approx(first_centroid(unit, sky), abs=5)


def first_position(unit: Harness, sky: Sky) -> dict[str, float]:
    unit.picture = sky.picture
    unit.command("CaptureImage", "DetectStars")
    return unit.telemetry("StarPositions")


def first_centroid(unit: Harness, sky: Sky) -> np.ndarray:
    values = first_position(unit, sky)
    return np.array([values["X_Coordinate"], values["Y_Coordinate"]])


def first_point(unit: Harness, sky: Sky) -> np.ndarray:
    values = first_position(unit, sky)
    return np.array([values["X_CorrectedCoordinate"], values["Y_CorrectedCoordinate"]])


def first_vector(unit: Harness, sky: Sky) -> np.ndarray:
    first_position(unit, sky)
    values = unit.telemetry("BodyUnitVectors")
    return np.array([values["VbX"], values["VbY"], values["VbZ"]])


@telecommand("CaptureTestPatern")
def capture_test_patern(unit: Harness, _: Sky) -> None:
    y, x = np.mgrid[:512, :1024]
    for pattern, expected in (
        (TestPattern.COLUMN_RAMP, x),
        (TestPattern.ROW_RAMP, y),
        (TestPattern.DIAGONAL_RAMP, x + y),
    ):
        unit.command("CaptureTestPatern", TestPaternType=pattern)
        assert np.array_equal(image(unit), expected % 256)
    unit.command("DetectStars")
    assert "StatusError" not in unit.flags()  # the pattern counts as a picture


@telecommand("CaptureImage")
def capture_image(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureImage")
    assert np.array_equal(image(unit), sky.picture)
    assert unit.status() is TaskStatus.CAPTURED
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 0


@telecommand("UploadImage")
def upload_image(unit: Harness, _: Sky) -> None:
    unit.command("UploadBlock", BlockNumber=3, Data=b"\x55" * 128)
    unit.command("UploadImage")
    assert not image(unit).any()
    shown(unit, "UploadStatus", NextBlock=0, BlocksReceived=0)
    for number in (7, 9, 9):
        unit.command("UploadBlock", BlockNumber=number, Data=bytes(128))
    shown(unit, "UploadStatus", NextBlock=10, BlocksReceived=3)


@telecommand("UploadBlock")
def upload_block(unit: Harness, sky: Sky) -> None:
    unit.command("UploadImage")
    for number, block in enumerate(sky.picture.reshape(-1, 128)):
        if block.any():
            unit.command("UploadBlock", BlockNumber=number, Data=block.tobytes())
    assert np.array_equal(image(unit), sky.picture)
    unit.command("UploadBlock", BlockNumber=4095, Data=bytes(128))
    assert unit.telemetry("UploadStatus")["NextBlock"] == 4096
    unit.command("ProcessImage")
    assert unit.telemetry("AttitudeQuaternion")["Valid"]


@telecommand("ImageBlockSet")
def image_block_set(unit: Harness, _: Sky) -> None:
    unit.command("CaptureTestPatern", TestPaternType=TestPattern.COLUMN_RAMP)
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
def stream_down_image(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureImage", "StreamDownImage")
    frames = unit.received()
    assert len(frames) == 4096
    assert b"".join(frames) == sky.picture.tobytes()


@telecommand("setDetectionRegion")
def set_detection_region(unit: Harness, sky: Sky) -> None:
    region = {"StepSize": 2, "Xstart": 100, "Xend": 600, "Ystart": 50, "Yend": 400}
    unit.command("setDetectionRegion", **region)
    shown(unit, "DetectionRegion", **region)
    first_position(unit, sky)
    inside = np.all((sky.pixels > (100, 50)) & (sky.pixels < (600, 400)), axis=1)
    assert 0 < inside.sum() < len(sky.stars)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == inside.sum()


@telecommand("setDetectionThresholds")
def set_detection_thresholds(unit: Harness, sky: Sky) -> None:
    unit.command("setDetectionThresholds", DetectionThreshold=200, StarThreshold=9)
    values = unit.telemetry("DetectionThresholdValues")
    assert (values["DetectionThreshold"], values["StarThreshold"]) == (200, 9)
    first_position(unit, sky)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 0  # they peak at 150


@telecommand("setStarPixels")
def set_star_pixels(unit: Harness, sky: Sky) -> None:
    unit.command("setStarPixels", MinPixels=100, MaxPixels=200)
    shown(unit, "StarPixels", MinPixels=100, MaxPixels=200)
    first_position(unit, sky)
    summary = unit.telemetry("DetectionSummary")
    assert (summary["NumStarsDetected"], summary["AmountOfNoise"]) == (0, len(sky.stars))
    unit.command("setStarPixels", MinPixels=2, MaxPixels=9)
    first_position(unit, sky)
    assert unit.telemetry("DetectionSummary")["NumInvalidStars"] >= len(sky.stars)


@telecommand("setDetectionVariables")
def set_detection_variables(unit: Harness, sky: Sky) -> None:
    limits = {"GridSize": 3, "MaxStars": 4, "MaxInvalidStars": 5, "MaxNoise": 6}
    unit.command("setDetectionVariables", **limits)
    shown(unit, "StarGrid", GridSize=3)
    shown(unit, "MaxStars", maxStars=4, maxInvalidStars=5, maxNoise=6)
    first_position(unit, sky)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 4


@telecommand("DetectStars")
def detect_stars(unit: Harness, sky: Sky) -> None:
    first_position(unit, sky)
    assert unit.status() is TaskStatus.DETECTED
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    assert unit.telemetry("NumIdStars")["numIdStars"] == 0


@telecommand("setIDMode")
def set_id_mode(unit: Harness, _: Sky) -> None:
    for mode in (0, 1):
        unit.command("setIDMode", IdMode=mode)
        shown(unit, "IDMode", Mode=mode)
        assert unit.telemetry("Results")["IDMode"] == mode


@telecommand("setTrackingMode")
def set_tracking_mode(unit: Harness, _: Sky) -> None:
    unit.command("setTrackingMode", RightAscension=1.0, Declination=-0.5)
    assert unit.telemetry("LoopStatus")["ModeFlag"] == MatchMode.ASSISTED


@telecommand("setIDMargin")
def set_id_margin(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMargin", Margin=0.0001)
    shown(unit, "IDMargin", Margin=0.0001)
    unit.command("setFocalLength", FocalLength=6.30)  # angles are wrong by 3 parts in 1000
    first_position(unit, sky)
    unit.command("IDStars")
    assert unit.status() is TaskStatus.IDENTIFICATION_FAILED


@telecommand("IDStars")
def id_stars(unit: Harness, sky: Sky) -> None:
    first_position(unit, sky)
    unit.command("IDStars")
    assert unit.status() is TaskStatus.IDENTIFIED
    count = unit.telemetry("NumIdStars")["numIdStars"]
    assert count == len(sky.stars)
    found = {unit.telemetry("IDStarsDetails")["Identity"] for _ in range(count)}
    assert found == set(sky.stars)


@telecommand("SelectBestStars")
def select_best_stars(unit: Harness, sky: Sky) -> None:
    first_position(unit, sky)
    unit.command("IDStars")
    shown(unit, "BestStarIndex", Star1Index=255, Star2Index=255, Star3Index=255)
    unit.command("SelectBestStars")
    chosen = unit.telemetry("BestStarIndex")
    assert len(set(chosen.values())) == 3
    magnitudes = [unit.telemetry(f"Star{n}Details")[f"S{n}Mag"] for n in (1, 2, 3)]
    assert magnitudes == sorted(magnitudes, reverse=True)  # all have as many votes


@telecommand("EstimateAttitude")
def estimate_attitude(unit: Harness, sky: Sky) -> None:
    first_position(unit, sky)
    unit.command("IDStars")
    assert not unit.telemetry("AttitudeQuaternion")["Valid"]
    unit.command("EstimateAttitude")
    assert unit.status() is TaskStatus.CALCULATED
    assert unit.telemetry("AttitudeQuaternion")["Valid"]
    assert unit.telemetry("AttitudeQuaternion")["Matched"] == len(sky.stars)
