"""The calibration of the lens: what its fits find of the polynomial that the lens follows."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import DISTORTION, PIXELS_PER_DEGREE, lens_of
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.host.studies.cubesense import lens_fits


def test_third_order_fit_of_whole_pixels_finds_the_printed_polynomial() -> None:
    found = lens_fits.fitted(lens_fits.noted_radii(lens_of(CameraTarget.NADIR)), 3)
    ideal = np.linspace(0, 95 * PIXELS_PER_DEGREE, 50)
    off = np.polyval(found, ideal) - np.polyval(DISTORTION, ideal)
    assert np.abs(off).max() < 0.6


def test_dot_is_noted_in_whole_pixels_at_the_printed_radii() -> None:
    radii = lens_fits.noted_radii(lens_of(CameraTarget.NADIR))
    assert radii.shape == (4, 20)
    assert np.array_equal(radii, np.round(radii))
    printed = np.polyval(DISTORTION, lens_fits.ANGLES_DEG * PIXELS_PER_DEGREE)
    assert np.abs(radii - printed).max() <= 0.5 + 1e-6


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_second_order_is_worse_and_the_edge_coarser(profile: str) -> None:
    opened: Any = SimpleNamespace(board={"profile": profile})
    found = lens_fits.lens_fits(opened, 0)
    assert found["rms_3"] < found["rms_2"] / 2
    # The slope of the polynomial at 2.5 and 92.5 deg.
    slope = np.polyval(np.polyder(DISTORTION), np.array([2.5, 92.5]) * PIXELS_PER_DEGREE)
    expected = 1 / (PIXELS_PER_DEGREE * slope)
    assert [found["first"], found["last"]] == pytest.approx(expected, rel=0.06)
    # Whole pixels alone have errors of a uniform distribution.
    assert found["rms_3"] > 0.6 / np.sqrt(12)
