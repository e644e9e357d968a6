"""Each term of the noise alone, against its formula in section 3.4 of the AraMiS thesis."""

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from cubestack.emulator.camera.common.dark import hot_pixels
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mt9m001 import imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import read_settings
from cubestack.emulator.light.noise import FrameNoise
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS

SHAPE = (400, 500)
QUIET = replace(CONDITION, hot_pixels=0)
LSB8 = imager.FULL_WELL_ELECTRONS / 256  # electrons of a count of 8 bits at gain 1


def frame(
    light: float | np.ndarray,
    terms: imager.NoiseTerms,
    gain: float = 1.0,
    condition: SkyCondition = QUIET,
    background: float = 15.0,
) -> np.ndarray:
    electrons = np.broadcast_to(np.float32(light), SHAPE)
    settings = replace(read_settings(RegisterFile(REGISTERS)), gains=(gain,) * 4)
    made = imager.Mt9m001Imager(0, terms, background)
    return made.counts(electrons, 1.0, condition, settings, FrameNoise([1]))


def quantisation_sigma(gain: float = 1.0) -> float:
    """Standard deviation of 8 bits' quantisation in electrons, equations 3.5 and 3.6."""
    return LSB8 / gain / np.sqrt(12)


def only(**terms: bool) -> imager.NoiseTerms:
    names = ("shot", "dark", "background", "quantisation", "readout")
    return imager.NoiseTerms(**(dict.fromkeys(names, False) | terms))


def electrons_sigma(picture: np.ndarray, gain: float = 1.0) -> float:
    return float(picture.std()) * LSB8 / gain


def test_noise_constants_reproduce_the_data_sheet_ratios() -> None:
    assert 20 * np.log10(np.sqrt(imager.FULL_WELL_ELECTRONS)) == pytest.approx(45)
    ratio = imager.FULL_WELL_ELECTRONS / imager.READ_NOISE_ELECTRONS
    assert 20 * np.log10(ratio) == pytest.approx(68.2)


def test_frame_without_noise_is_uniform() -> None:
    picture = frame(10_000, imager.NoiseTerms.none())
    expected = 10_000 / LSB8 + imager.BLACK_LEVEL / 4
    assert np.unique(picture).tolist() == [int(expected + 0.5)]


@pytest.mark.parametrize(
    ("term", "light", "gain", "sigma"),
    [
        ("shot", 4_000, 1.0, np.sqrt(4_000)),
        ("shot", 25_000, 1.0, np.sqrt(25_000)),
        ("readout", 2_000, 8.0, imager.READ_NOISE_ELECTRONS),
    ],
)
def test_each_noise_term_has_its_published_sigma(
    term: str, light: float, gain: float, sigma: float
) -> None:
    measured = electrons_sigma(frame(light, only(**{term: True}), gain), gain)
    assert measured == pytest.approx(np.hypot(sigma, quantisation_sigma(gain)), rel=0.02)


def test_dark_current_adds_noise_but_no_mean_and_doubles_per_8_deg() -> None:
    assert imager.dark_electrons_per_s(33) / imager.dark_electrons_per_s(25) == pytest.approx(2)
    gain, warm = 8.0, 65.0
    dark = imager.dark_electrons_per_s(warm)
    condition = replace(QUIET, temperature_c=warm)
    picture = frame(1_500, only(dark=True), gain, condition)
    rounding = quantisation_sigma(gain)
    assert electrons_sigma(picture, gain) == pytest.approx(np.hypot(dark**0.5, rounding), rel=0.02)
    plain = frame(1_500, only(), gain, condition)
    assert picture.mean() == pytest.approx(plain.mean(), abs=0.5)


def test_background_adds_its_mean_and_its_noise() -> None:
    gain = 8.0
    picture = frame(500, only(background=True), gain, background=1_000.0)
    plain = frame(500, only(), gain)
    assert picture.mean() - plain.mean() == pytest.approx(1_000 * gain / LSB8, abs=0.5)
    rounding = quantisation_sigma(gain)
    assert electrons_sigma(picture, gain) == pytest.approx(np.hypot(1_000**0.5, rounding), rel=0.03)


def test_quantisation_noise_follows_its_formula() -> None:
    rng = np.random.default_rng(2)
    light = rng.uniform(5_000, 25_000, SHAPE).astype(np.float32)

    def error(terms: imager.NoiseTerms) -> np.ndarray:
        return light - (frame(light, terms) - imager.BLACK_LEVEL / 4) * LSB8

    wired = error(only(quantisation=True))
    # The upper 8 of 10 bits: the error of 8 bits, and on the average what is cut off.
    assert wired.std() == pytest.approx(quantisation_sigma(), rel=0.02)
    assert wired.mean() == pytest.approx(1.5 * LSB8 / 4, rel=0.05)
    assert error(only()).mean() == pytest.approx(0, abs=0.02 * LSB8)


@pytest.mark.parametrize(("quantisation", "least_of_one"), [(True, 3.5 / 4), (False, 0.5)])
def test_pixel_values_are_clipped_to_0_and_255(quantisation: bool, least_of_one: float) -> None:
    """At this gain the noise of a dark pixel often goes below what is 1, of 8 bits."""
    gain = 15.0
    light = np.zeros(SHAPE)
    light[SHAPE[0] // 2 :] = 2 * imager.FULL_WELL_ELECTRONS
    dark, bright = np.split(frame(light, only(readout=True, quantisation=quantisation), gain), 2)
    counts = NormalDist(imager.BLACK_LEVEL / 4, imager.READ_NOISE_ELECTRONS * gain / LSB8)
    assert (dark == 0).mean() == pytest.approx(counts.cdf(least_of_one), abs=0.01)
    assert (bright == 255).all()


def test_noise_terms_add_as_variances() -> None:
    light, gain, background = 800.0, 8.0, 15.0
    variance = light + imager.dark_electrons_per_s(20.0) + background
    variance += imager.READ_NOISE_ELECTRONS**2 + quantisation_sigma(gain) ** 2
    measured = electrons_sigma(frame(light, imager.NoiseTerms(), gain), gain)
    assert measured == pytest.approx(np.sqrt(variance), rel=0.02)


def test_hot_pixels_keep_their_places_and_scale_with_dark_current() -> None:
    places, shares = hot_pixels(7, 10, SHAPE[0] * SHAPE[1], imager.HOT_SHARE)
    picture = frame(0, only(dark=True), condition=replace(CONDITION, hot_pixels=10, seed=7))
    bright = set(np.flatnonzero(picture > 10).tolist())
    strong = set(places[shares * imager.dark_electrons_per_s(20.0) > 12 * LSB8].tolist())
    assert strong
    assert strong <= bright <= set(places.tolist())
    repeated = hot_pixels.__wrapped__(7, 10, SHAPE[0] * SHAPE[1])
    np.testing.assert_array_equal(repeated[0], places)
