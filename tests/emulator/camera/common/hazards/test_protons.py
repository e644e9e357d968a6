"""Against figures of NIST's PSTAR and of published measurements, not against the formulas."""

from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.dark import dark_at, hot_pixels
from cubestack.emulator.camera.common.hazards import protons
from cubestack.emulator.camera.common.hazards.contract import Exposure, SensorHazard
from cubestack.emulator.camera.common.hazards.dose import Dose

CUBESTAR = Exposure((512, 1024), 5.6, 0.3856, 20.0, 36.48)
WARM = replace(CUBESTAR, temperature_c=27.0)
ONE = np.ones(1)


def drawn(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def charge(hazard: SensorHazard, seed: int = 0, exposure: Exposure = CUBESTAR) -> np.ndarray:
    image = hazard.charge(exposure, drawn(seed))
    return np.zeros(exposure.shape, np.float32) if image is None else image


# PSTAR, silicon, total stopping power in MeV cm2/g; 2.329 g/cm3.
@pytest.mark.parametrize(("mev", "pstar"), [(10, 34.6), (50, 9.9), (100, 5.8), (1000, 1.77)])
def test_mean_loss_is_the_published_stopping_power(mev: float, pstar: float) -> None:
    assert protons.mean_loss_kev(mev * ONE, ONE)[0] == pytest.approx(pstar * 0.2329, rel=0.03)


def test_minimum_ionising_proton_loss_matches_measurements() -> None:
    # Measured: most probable 0.19 to 0.23 keV/um in 5.6 to 10 um; some 80 pairs in 300 um.
    many = np.ones(40_000)
    thin = protons.lost_kev(2500 * many, 8 * many, drawn(1)) / 8
    counts, edges = np.histogram(thin, 60, (0, 0.6))
    assert edges[np.argmax(counts)] == pytest.approx(0.19, abs=0.03)
    thick = np.median(protons.lost_kev(2500 * many, 300 * many, drawn(2))) / 300
    assert thick * 1000 / protons.PAIR_EV == pytest.approx(80, rel=0.1)


def test_most_probable_proton_loss_follows_landau() -> None:
    # Its peak is at -0.223: loss - mean = xi (-0.223 + 0.423 + beta^2 + ln(xi / largest)), keV.
    gamma = 1 + 1000 / 938.27
    beta2 = 1 - gamma**-2
    xi, largest = 0.01783 * 8 / beta2, 1022 * (gamma**2 - 1) / 1.0023
    peak = 1.77 * 0.2329 * 8 + xi * (0.2 + beta2 + np.log(xi / largest))
    lost = protons.lost_kev(1000 * np.ones(40_000), 8 * np.ones(40_000), drawn(4))
    # Half of Moyal's curve, which stands in for it, is beyond 0.787 xi above the peak.
    assert np.median(lost) - 0.787 * xi == pytest.approx(peak, abs=0.1)


def test_slow_protons_lose_the_tabulated_energy() -> None:
    many = np.ones(20_000)
    electrons = protons.lost_kev(20 * many, 8 * many, drawn(3)) * 1000 / protons.PAIR_EV
    # 20 MeV: 19.7 MeV cm2/g, of which fast delta rays take a little; 3.65 eV a pair.
    assert electrons.mean() == pytest.approx(19.7 * 0.2329 * 8 * 1000 / 3.65, rel=0.1)
    assert electrons.min() > 0


def test_number_of_hits_follows_rate_area_and_exposure() -> None:
    # 0.1644 cm2 for 0.3856 s at 500 / (cm2 s), and at 3000 over a pole.
    assert protons.Protons().mean_hits(CUBESTAR) == pytest.approx(31.7, rel=0.01)
    area = 512 * 1024 * 5.6e-4**2
    solar = protons.Protons(orbit="solar").mean_hits(CUBESTAR)
    assert solar == pytest.approx(3000 * area * 0.3856, rel=1e-5)
    quiet = protons.Protons(orbit="quiet")
    hit = sum(bool(charge(quiet, seed).any()) for seed in range(400))
    assert hit / 400 == pytest.approx(1 - np.exp(-0.0634), abs=0.04)


@pytest.mark.slow
def test_proton_track_lengths_follow_isotropic_incidence() -> None:
    # Squared cosines of the angle of incidence are even: half of the tracks go more than as far
    # across as the layer is deep, a tenth three times that.
    lengths = []
    for seed in range(600):
        image = charge(protons.Protons(hits=1, orbit="quiet"), seed)
        y, x = np.nonzero(image)
        if len(x):
            spread = sum(np.cov(axis * 5.6, aweights=image[y, x], ddof=0) for axis in (x, y))
            # An even line's variance, and that of diffusion and pixels in both axes.
            lengths.append(np.sqrt(max(12 * (spread - 2 * 2.0**2 - 2 * 5.6**2 / 12), 0)))
    assert np.median(lengths) == pytest.approx(8, rel=0.2)
    assert np.quantile(lengths, 0.9) == pytest.approx(24, rel=0.25)


def test_track_charge_equals_the_energy_loss() -> None:
    hits = 3000
    total = charge(protons.Protons(hits=hits)).sum()
    generator = drawn(9)
    energies = np.clip(60 * 2.5 ** generator.standard_normal(hits), 5, 1e5)
    paths = 8 / np.maximum(np.sqrt(generator.random(hits)), 0.02)
    near = (protons.lost_kev(energies, paths, generator) * 1000 / protons.PAIR_EV).sum()
    # Delta rays leave a few percent more; some charge falls beside the sensor.
    assert 0.9 * near < total < 1.2 * near


def test_proton_track_charge_is_centred_on_its_middle() -> None:
    starts, along = np.array([[60.0, 20.0]]), np.array([[900.0, 450.0]])
    image = protons._tracks(starts, along, 1e6 * ONE, CUBESTAR, drawn(5))
    middle = [np.average(axis, weights=image) for axis in np.indices(image.shape)[::-1]]
    np.testing.assert_allclose(middle, [510, 245], atol=0.006)


def test_tracks_repeat_per_frame_and_differ_between_frames() -> None:
    first = charge(protons.Protons(hits=100), 1)
    np.testing.assert_array_equal(first, charge(protons.Protons(hits=100), 1))
    other = charge(protons.Protons(hits=100), 2)
    assert np.sum((first > 0) & (other > 0)) < 0.05 * np.sum(first > 0)
    assert protons.Protons(hits=0).charge(CUBESTAR, drawn(0)) is None


def test_mean_dark_current_is_that_of_the_universal_damage_factor() -> None:
    # Srour and Lo: (1.9 +- 0.6)e5 / (cm3 s) for each MeV/g at 300 K. 1 krad has 2.5e6 MeV/g here.
    volume_cm3 = 5.6e-4**2 * 3e-4
    expected = 1.9e5 * 2.5e6 * volume_cm3
    mean = charge(Dose(krad=1.0), exposure=WARM).mean() / WARM.seconds
    assert expected * 1.3 / 1.9 < mean < expected * 2.5 / 1.9


def test_dose_sets_the_count_and_temperature_the_strength() -> None:
    small, large = (charge(Dose(krad=krad), exposure=WARM) for krad in (0.1, 1.0))
    assert np.sum(large > 0) == pytest.approx(10 * np.sum(small > 0), rel=0.1)
    assert large[large > 0].mean() == pytest.approx(small[small > 0].mean(), rel=0.1)
    hotter = charge(Dose(krad=1.0), exposure=replace(WARM, temperature_c=35.0))
    np.testing.assert_allclose(hotter, 2 * large, rtol=1e-5)
    assert not Dose(krad=0.0).charge(WARM, drawn(0)).any()
    assert Dose(krad=0.0).dark_rise() == 1


def test_dose_hot_pixels_are_the_same_in_every_frame() -> None:
    first = charge(Dose(krad=1.0, seed=4), seed=1)
    np.testing.assert_array_equal(first, charge(Dose(krad=1.0, seed=4), seed=2))
    assert np.any(first != charge(Dose(krad=1.0, seed=5), seed=1))


@pytest.mark.parametrize(
    ("temperature_c", "factor"), [(20, 1), (28, 2), (36, 4), (12, 0.5), (24, 2**0.5)]
)
def test_dark_current_doubles_every_8_degrees(temperature_c: float, factor: float) -> None:
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
