from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.dark import dark_at, hot_pixels
from cubestack.emulator.camera.common.hazards.contract import Exposure
from cubestack.emulator.camera.common.hazards.dose import Dose

WARM = Exposure((512, 1024), 5.6, 0.3856, 27.0, 36.48)


def charge(hazard: Dose, exposure: Exposure = WARM, seed: int = 0) -> np.ndarray:
    image = hazard.charge(exposure, np.random.default_rng(seed))
    assert image is not None
    return image


def test_mean_dark_current_is_that_of_the_universal_damage_factor() -> None:
    # Srour and Lo: (1.9 +- 0.6)e5 / (cm3 s) for each MeV/g at 300 K. 1 krad has 2.5e6 MeV/g here.
    volume_cm3 = 5.6e-4**2 * 3e-4
    expected = 1.9e5 * 2.5e6 * volume_cm3
    mean = charge(Dose(krad=1.0)).mean() / WARM.seconds
    assert expected * 1.3 / 1.9 < mean < expected * 2.5 / 1.9


def test_dose_sets_the_count_and_temperature_the_strength() -> None:
    small, large = charge(Dose(krad=0.1)), charge(Dose(krad=1.0))
    assert np.sum(large > 0) == pytest.approx(10 * np.sum(small > 0), rel=0.1)
    assert large[large > 0].mean() == pytest.approx(small[small > 0].mean(), rel=0.1)
    hotter = charge(Dose(krad=1.0), replace(WARM, temperature_c=35.0))
    np.testing.assert_allclose(hotter, 2 * large, rtol=1e-5)


def test_places_are_the_sensor_s_in_every_frame() -> None:
    first = charge(Dose(krad=1.0, seed=4), seed=1)
    np.testing.assert_array_equal(first, charge(Dose(krad=1.0, seed=4), seed=2))
    assert np.any(first != charge(Dose(krad=1.0, seed=5), seed=1))


def test_zero_dose_causes_no_damage() -> None:
    assert not charge(Dose(krad=0.0)).any()
    assert Dose(krad=0.0).dark_rise() == 1


@pytest.mark.parametrize(
    ("temperature_c", "factor"), [(20, 1), (28, 2), (36, 4), (12, 0.5), (24, 2**0.5)]
)
def test_eight_degrees_double_it(temperature_c: float, factor: float) -> None:
    assert dark_at(3.0, temperature_c, 20.0) == pytest.approx(3.0 * factor)


def test_hot_pixels_have_the_requested_count_and_fixed_places() -> None:
    places, strengths = hot_pixels(5, 4000, 5000, 2.5)
    assert len(set(places.tolist())) == len(places) == len(strengths) == 4000
    assert places.min() >= 0
    assert places.max() < 5000
    # Exponential: the standard deviation is the mean.
    assert strengths.mean() == pytest.approx(2.5, rel=0.05)
    assert strengths.std() == pytest.approx(2.5, rel=0.06)
    assert hot_pixels(5, 4000, 5000)[1].mean() == pytest.approx(1.0, rel=0.05)
    assert (hot_pixels(6, 4000, 5000)[0] != places).any()
    assert len(hot_pixels(5, 0, 5000)[0]) == 0
