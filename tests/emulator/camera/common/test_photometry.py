import numpy as np
import pytest

from cubestack.emulator.camera.common.photometry import (
    DN12_PER_DN8,
    EFFECTIVE_WIDTH_A,
    ELECTRONS_PER_DN12,
    electrons_per_second,
)


def test_star_at_the_detection_limit() -> None:
    electrons = electrons_per_second(3.8) * 0.3856
    assert electrons / ELECTRONS_PER_DN12 / DN12_PER_DN8 == pytest.approx(300, abs=1)


def test_width_is_within_the_published_factors() -> None:
    assert 0.6 * 3000 < EFFECTIVE_WIDTH_A < 0.8 * 6000


def test_flux_falls_by_a_hundred_in_five_magnitudes() -> None:
    bright, faint = electrons_per_second([0.0, 5.0])
    assert bright / faint == pytest.approx(100)


def test_flux_against_equation_3_4_2() -> None:
    # Aperture in cm^2, times width, times 10^((15 - 2M)/5) photons.
    for magnitude in np.linspace(-1.4, 6, 12):
        expected = np.pi * 0.25**2 * EFFECTIVE_WIDTH_A * 10 ** ((15 - 2 * magnitude) / 5)
        assert electrons_per_second(magnitude) == pytest.approx(expected)
