"""What the algorithms are configured with, taken from the settings of telecommands 8 to 23."""

import math

from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.detection import DetectionConfig
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.node.settings import Settings


def detection_config(settings: Settings) -> DetectionConfig:
    """Region, thresholds and limits of the search."""
    region = settings.all("setDetectionRegion")
    thresholds = settings.all("setDetectionThresholds")
    pixels = settings.all("setStarPixels")
    limits = settings.all("setDetectionVariables")
    return DetectionConfig(
        step=region["StepSize"],
        x_start=region["Xstart"],
        x_end=region["Xend"] + 1,
        y_start=region["Ystart"],
        y_end=region["Yend"] + 1,
        detection_threshold=thresholds["DetectionThreshold"],
        star_threshold=thresholds["StarThreshold"],
        min_pixels=pixels["MinPixels"],
        max_pixels=pixels["MaxPixels"],
        grid_size=limits["GridSize"],
        max_stars=limits["MaxStars"],
        max_invalid=limits["MaxInvalidStars"],
        max_noise=limits["MaxNoise"],
    )


def camera_parameters(settings: Settings) -> CameraParameters:
    """Calibration of camera and lens."""
    radial = settings.all("setRadialDistortionGains")
    tangential = settings.all("setTangentalDistortionGains")
    return CameraParameters(
        focal_length_mm=settings.get("setFocalLength", "FocalLength"),
        fx=settings.get("setFocalLengthComponents", "Fx"),
        fy=settings.get("setFocalLengthComponents", "Fy"),
        cx=settings.get("setPrincipalPoint", "Cx"),
        cy=settings.get("setPrincipalPoint", "Cy"),
        k1=radial["K1"],
        k2=radial["K2"],
        p1=tangential["P1"],
        p2=tangential["P2"],
    )


def field_radius_deg(camera: CameraParameters) -> float:
    """Angle between the boresight and the picture's farthest corner, distortion left out."""
    x, y = max(camera.cx, COLUMNS - camera.cx), max(camera.cy, ROWS - camera.cy)
    return math.degrees(math.atan(math.hypot(x, y) * camera.pitch_mm / camera.focal_length_mm))
