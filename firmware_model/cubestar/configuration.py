"""Configuration of the algorithms, from the settings of telecommands 8 to 23."""

import numpy as np

from cubestack.firmware_model.attitude.field_of_view import FieldOfView, field_of_view
from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.detection import DetectionConfig
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar.telecommands import MOST_STARS
from cubestack.firmware_model.node.state import Settings


def detection_config(
    settings: Settings, *, plain_weights: bool = False, background: bool = False
) -> DetectionConfig:
    """Region, thresholds and limits of the search; see ``DetectionConfig``.

    Settings that this hardware cannot follow are replaced by the nearest possible ones.
    """
    values = settings.all(
        "setDetectionRegion", "setDetectionThresholds", "setStarPixels", "setDetectionVariables"
    )
    return DetectionConfig(
        step=max(values["StepSize"], 1),
        x_start=values["Xstart"],
        x_end=values["Xend"] + 1,
        y_start=values["Ystart"],
        y_end=values["Yend"] + 1,
        detection_threshold=values["DetectionThreshold"],
        star_threshold=values["StarThreshold"],
        min_pixels=values["MinPixels"],
        max_pixels=values["MaxPixels"],
        grid_size=values["GridSize"] | 1,
        max_stars=min(max(values["MaxStars"], 1), MOST_STARS),
        max_invalid=values["MaxInvalidStars"],
        max_noise=values["MaxNoise"],
        plain_weights=plain_weights,
        background=background,
    )


def camera_parameters(settings: Settings) -> CameraParameters:
    values = settings.all(
        "setFocalLengthComponents",
        "setPrincipalPoint",
        "setRadialDistortionGains",
        "setTangentalDistortionGains",
    )
    return CameraParameters(
        settings.get("setFocalLength", "FocalLength"),
        **{name.lower(): value for name, value in values.items()},
    )


def field(settings: Settings) -> FieldOfView:
    return field_of_view(camera_parameters(settings), COLUMNS, ROWS)


def field_cosine(camera: CameraParameters) -> np.float32:
    """Cosine of the angle from boresight to the farthest image corner, without distortion."""
    one, cx, cy = np.float32(1), np.float32(camera.cx), np.float32(camera.cy)
    scale = np.float32(camera.pitch_mm) / np.float32(camera.focal_length_mm)
    x, y = max(cx, COLUMNS - cx) * scale, max(cy, ROWS - cy) * scale
    return np.float32(one / np.sqrt(one + x * x + y * y))
