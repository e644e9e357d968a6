"""Effects of telecommands: optics, picture, stars, attitude."""

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubestar import (
    IMAGE_BYTES,
    MatchMode,
    TaskStatus,
    TestPattern,
)

from .bench import Bench
from .effects import shown, telecommand
from .sky import Sky


def image(bench: Bench) -> np.ndarray:
    return bench.external_ram[:IMAGE_BYTES].reshape(512, 1024)


# --- optics ---------------------------------------------------------------------------------------


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
    assert bench.status() is TaskStatus.CAPTURED
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
    assert bench.status() is TaskStatus.DETECTED
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
    assert bench.status() is TaskStatus.IDENTIFICATION_FAILED


@telecommand("IDStars")
def id_stars(bench: Bench, sky: Sky) -> None:
    first_position(bench, sky)
    bench.command("IDStars")
    assert bench.status() is TaskStatus.IDENTIFIED
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
    assert bench.status() is TaskStatus.CALCULATED
    assert bench.telemetry("AttitudeQuaternion")["Valid"]
    assert bench.telemetry("AttitudeQuaternion")["Matched"] == len(sky.stars)
