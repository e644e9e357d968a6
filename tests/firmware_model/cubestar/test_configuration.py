import numpy as np
import pytest

from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.configuration import (
    camera_parameters,
    detection_config,
    field_cosine,
)
from cubestack.firmware_model.cubestar.detection import DetectionConfig
from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.node.state import Settings


def reset_settings() -> Settings:
    return Settings(INTERFACE, SETTING_COMMANDS)


def test_the_reset_values_are_the_published_ones() -> None:
    assert detection_config(reset_settings()) == DetectionConfig()
    # Figure 5.12, coefficients with inverted sign, and the focal length of section 5.4.
    published = CameraParameters(
        6.28, 1147.5, 1147.4, 539.0, 175.5, 0.32358, -0.12456, -0.00414, 0.00624
    )
    assert vars(camera_parameters(reset_settings())) == pytest.approx(vars(published), rel=1e-6)


def test_every_setting_has_its_place() -> None:
    settings = reset_settings()
    region = {"StepSize": 4, "Xstart": 10, "Xend": 20, "Ystart": 30, "Yend": 40}
    settings.put("setDetectionRegion", region)
    settings.put("setDetectionThresholds", {"DetectionThreshold": 50, "StarThreshold": 51})
    settings.put("setStarPixels", {"MinPixels": 7, "MaxPixels": 70})
    limits = {"GridSize": 9, "MaxStars": 11, "MaxInvalidStars": 12, "MaxNoise": 13}
    settings.put("setDetectionVariables", limits)
    assert detection_config(settings) == DetectionConfig(
        step=4,
        x_start=10,
        x_end=21,  # the telecommand includes the end
        y_start=30,
        y_end=41,
        detection_threshold=50,
        star_threshold=51,
        min_pixels=7,
        max_pixels=70,
        grid_size=9,
        max_stars=11,
        max_invalid=12,
        max_noise=13,
    )
    settings.put("setFocalLength", {"FocalLength": 8.0})
    settings.put("setFocalLengthComponents", {"Fx": 1001.0, "Fy": 1002.0})
    settings.put("setPrincipalPoint", {"Cx": 501.0, "Cy": 252.0})
    settings.put("setRadialDistortionGains", {"K1": 0.1, "K2": 0.2})
    settings.put("setTangentalDistortionGains", {"P1": 0.3, "P2": 0.4})
    expected = CameraParameters(8.0, 1001.0, 1002.0, 501.0, 252.0, 0.1, 0.2, 0.3, 0.4)
    assert camera_parameters(settings) == expected


@pytest.mark.parametrize(("cx", "cy"), [(539.0, 175.5), (512.0, 256.0), (100.0, 500.0)])
def test_the_field_reaches_to_the_farthest_corner(cx: float, cy: float) -> None:
    settings = reset_settings()
    settings.put("setPrincipalPoint", {"Cx": cx, "Cy": cy})
    x, y = np.meshgrid([0, 1024], [0, 512])
    farthest = np.hypot(x - cx, y - cy).max()
    expected = np.cos(np.arctan(farthest * 0.0056 / 6.28))
    assert field_cosine(camera_parameters(settings)) == pytest.approx(expected, rel=2e-7)


def test_settings_that_the_hardware_can_not_follow_act_as_the_nearest() -> None:
    settings = Settings(INTERFACE, SETTING_COMMANDS)
    wide = {"GridSize": 4, "MaxStars": 99, "MaxInvalidStars": 50, "MaxNoise": 13}
    settings.put("setDetectionVariables", wide)
    config = detection_config(settings)
    assert (config.grid_size, config.max_stars, config.max_invalid) == (5, 20, 50)
    settings.put("setDetectionVariables", wide | {"GridSize": 15, "MaxStars": 0})
    settings.put("setDetectionRegion", settings.all("setDetectionRegion") | {"StepSize": 0})
    config = detection_config(settings)
    assert (config.grid_size, config.max_stars, config.step) == (15, 1, 1)
