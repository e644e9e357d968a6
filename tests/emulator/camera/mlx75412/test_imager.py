from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.dark import hot_pixels
from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mlx75412 import imager as chip
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import grey_values
from cubestack.emulator.scene.sky import PictureScene, SkyScene
from tests.emulator.scene.hazards.around import SHUTTER as LONG

ORION = replace(SkyScene.pointing(83.8, -1.0), mag_limit=3.8)
RAW = chip.Corrections(defects=False, fixed_pattern=False, dark=False)
BITS = chip.DN12_PER_DN8 * chip.ELECTRONS_PER_DN12  # electrons per count of 8 bits


def flat(electrons: float) -> np.ndarray:
    return np.full((512, 1024), electrons, np.float32)


def frame(
    electrons: np.ndarray,
    corrections: chip.Corrections = chip.Corrections(),  # noqa: B008 - frozen
    exposure_s: float = 0.3,
    temperature_c: float = 20.0,
    seed: int = 1,
    part: int = 0,
    hot: int = 0,
) -> np.ndarray:
    condition = replace(CONDITION, temperature_c=temperature_c, hot_pixels=hot, seed=9)
    imager, noise = chip.Mlx75412Imager(part), FrameNoise([seed])
    return imager.counts(electrons, exposure_s, condition, corrections, noise).astype(float)


def test_ideal_counts_are_the_upper_bits_of_12() -> None:
    every = np.arange(4096, dtype=np.float32)
    odd = np.array([7.4, 15.6, 31.4, 9000], np.float32)  # 15.6 rounds to 16; beyond is saturated
    dn12 = np.concatenate([every, odd]) * np.float32(chip.ELECTRONS_PER_DN12)
    np.testing.assert_array_equal(
        grey_values(dn12[None], chip.IDEAL)[0], [*(np.arange(4096) >> 4), 0, 1, 1, 255]
    )


def test_dark_signal_at_65_c_matches_the_published_value() -> None:
    assert chip.dark_dn12_per_second(65) == 1008
    assert chip.dark_dn12_per_second(57) == pytest.approx(504)
    # Uncorrected, at 65 C, 0.3 s: 302 counts of 12 bits.
    counts = frame(flat(0), RAW, temperature_c=65)
    assert counts.mean() == pytest.approx(302 / 16 - 0.5, abs=0.2)


def test_dark_rows_remove_the_mean_dark_signal() -> None:
    assert frame(flat(100 * BITS), temperature_c=65).mean() == pytest.approx(100 - 0.5, abs=0.1)
    dark = frame(flat(0), temperature_c=65)
    assert dark.mean() < 2.5  # only the positive half of the noise is left
    assert np.mean(dark == 0) > 0.4


@pytest.mark.parametrize("level", [20.0, 60.0, 150.0, 230.0])
def test_noise_is_poisson_plus_read_noise(level: float) -> None:
    # Two frames of one sensor: the difference has no fixed pattern.
    electrons = level * BITS
    first, second = (frame(flat(electrons), exposure_s=0.0, seed=s) for s in (1, 2))
    # Quantisation adds 1/12 of a squared step of 8 bits per frame.
    expected = (electrons + chip.READ_NOISE_ELECTRONS**2) / BITS**2 + 1 / 12
    inside = (first > 0) & (first < 255) & (second > 0) & (second < 255)
    assert np.var(first[inside] - second[inside]) / 2 == pytest.approx(expected, rel=0.02)


def test_normal_noise_approximates_poisson_plus_read_noise() -> None:
    # The worst case for the approximation is a mean of twice the squared read noise.
    mean = 2 * chip.READ_NOISE_ELECTRONS**2
    counts = frame(flat(mean), chip.Corrections(), exposure_s=0.0)
    generator = np.random.default_rng(3)
    exact = generator.poisson(mean, 500_000).astype(float)
    exact += generator.normal(0, chip.READ_NOISE_ELECTRONS, 500_000)
    reference = grey_values(exact.astype(np.float32)[None], chip.IDEAL).astype(float)
    for level in range(4, 12):
        assert np.mean(counts >= level) == pytest.approx(np.mean(reference >= level), abs=0.01)


def test_dark_sky_is_nearly_black() -> None:
    # At room temperature the noise alone must not look like stars: threshold 6, thesis 5.3.3.
    counts = frame(flat(0))
    assert np.mean(counts > 0) < 0.005
    assert np.sum(counts > 6) <= chip.FACTORY_HOT


def test_fixed_pattern_noise_is_reduced_by_its_correction() -> None:
    def columns(corrections: chip.Corrections) -> float:
        frames = [frame(flat(100 * BITS), corrections, 0.0, seed=s) for s in range(4)]
        return float(np.mean(frames, axis=0).mean(axis=0).std())

    raw = columns(chip.Corrections(fixed_pattern=False))
    assert raw == pytest.approx(4 / 16, rel=0.15)  # 4 counts of 12 bits between columns
    assert columns(chip.Corrections()) < 0.2 * raw


def test_factory_defects_are_corrected_unless_raw() -> None:
    bright = flat(100 * BITS)
    raw, corrected = frame(bright, RAW, exposure_s=0.4), frame(bright, exposure_s=0.4)
    assert np.sum(raw < 20) == chip.FACTORY_DEAD
    assert np.sum(corrected < 50) == 0
    dark = frame(flat(0), RAW, exposure_s=0.4)
    assert 5 < np.sum(dark > 20) <= chip.FACTORY_HOT  # mean strength 37 counts, exponential
    assert np.sum(frame(flat(0), exposure_s=0.4) > 20) == 0


def test_grown_hot_pixels_are_not_corrected() -> None:
    hot = hot_pixels(9, 50, 512 * 1024)
    counts = frame(flat(0), exposure_s=0.4, hot=50)
    bright = np.flatnonzero(counts.ravel() > 10)
    assert len(bright) > 20
    assert set(bright) <= set(hot[0])
    assert frame(flat(0), exposure_s=0.4, temperature_c=-20, hot=50).max() <= 10
    np.testing.assert_array_equal(hot[0], hot_pixels.__wrapped__(9, 50, 512 * 1024)[0])
    assert set(hot[0]) != set(hot_pixels(10, 50, 512 * 1024)[0])


def test_seeds_repeat_a_sensor_and_a_frame() -> None:
    electrons = flat(30 * BITS)
    np.testing.assert_array_equal(frame(electrons), frame(electrons))
    assert np.any(frame(electrons) != frame(electrons, seed=2))
    # Another part has its defects elsewhere.
    first, second = (frame(flat(100 * BITS), RAW, part=p) < 20 for p in (0, 1))
    assert not np.any(first & second)


def test_sensor_saturates_and_leaves_its_input_unchanged() -> None:
    electrons = flat(5000 * chip.ELECTRONS_PER_DN12)
    before = electrons.copy()
    assert frame(electrons)[100:110].min() == 255
    np.testing.assert_array_equal(electrons, before)


def picture(
    scene: SkyScene | PictureScene,
    shutter: RollingShutter = LONG,
    condition: SkyCondition = CONDITION,
) -> np.ndarray:
    return chip.Mlx75412Imager(seed=2).render(scene, condition, shutter, chip.Corrections())


def test_noise_repeats_for_the_same_scene_and_frame_only() -> None:
    first = picture(ORION)
    assert np.any(first != picture(ORION, condition=replace(CONDITION, seed=1)))
    assert np.any(first != picture(ORION, replace(LONG, readout_ps=2 * 10**12)))
    imager = chip.Mlx75412Imager(seed=2)  # whatever else was rendered
    imager.render(ORION, CONDITION, replace(LONG, readout_ps=5), chip.Corrections())
    np.testing.assert_array_equal(imager.render(ORION, CONDITION, LONG, chip.Corrections()), first)


def test_frame_without_noise_equals_the_ideal_counts() -> None:
    quiet = picture(ORION, condition=replace(CONDITION, noise=False, temperature_c=65))
    np.testing.assert_array_equal(quiet, grey_values(star_light(ORION, LENS, LONG), chip.IDEAL))
    assert quiet.flags.c_contiguous


def test_hot_pixels_come_from_the_condition() -> None:
    dark = replace(ORION, mag_limit=-5)
    assert picture(dark, condition=replace(CONDITION, hot_pixels=0)).max() < 6
    assert np.sum(picture(dark, condition=replace(CONDITION, hot_pixels=100)) > 6) > 50


@pytest.mark.parametrize(
    ("lines", "programmed", "scale"),
    [(2917, 2917, 1.0), (100, 100, 1.0), (1000, 2000, 0.5), (2000, 1000, 2.0)],
)
def test_photograph_scales_with_exposure_only_in_the_undefined_frame(
    striped: PictureScene, lines: int, programmed: int, scale: float
) -> None:
    shutter = replace(LONG, exposure_lines=lines, programmed_lines=programmed)
    expected = np.minimum(striped.pixels * scale // 1, 255)
    np.testing.assert_array_equal(picture(striped, shutter), expected)


def test_photograph_with_a_known_exposure_scales(striped: PictureScene) -> None:
    known = replace(striped, exposure_ms=LONG.exposure_s * 2000)
    np.testing.assert_allclose(picture(known), striped.pixels // 2, atol=1)
    longer = replace(striped, exposure_ms=LONG.exposure_s * 8000 / 7)
    np.testing.assert_array_equal(picture(longer), striped.pixels * 7.0 // 8)


def test_sensors_of_one_seed_share_an_imager_that_does_not_change() -> None:
    shared, own = chip.imager_of(3), chip.Mlx75412Imager(3)
    assert shared is chip.imager_of(3)
    assert vars(shared).keys() == vars(own).keys()
    for name, value in vars(shared).items():
        np.testing.assert_array_equal(value, getattr(own, name))
        for array in value if isinstance(value, tuple) else [value]:
            assert not array.flags.writeable
    assert not np.array_equal(shared._gain, chip.imager_of(4)._gain)
