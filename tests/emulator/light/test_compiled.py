"""Compiled library and NumPy compute the same, to the byte."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.camera.mlx75412.sensor import Mlx75412
from cubestack.emulator.light import globe, library, pixels, spots
from cubestack.emulator.light.distortion import Brown
from cubestack.emulator.light.lens_curve import LensCurve
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import Most, PixelModel
from cubestack.emulator.native import compiler
from cubestack.emulator.native.cache import collected
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.sky import SkyScene
from tests.together import together

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

SHAPE = (301, 1003)  # no multiples; large enough that a difference of rounding changes some byte
PIXELS = SHAPE[0] * SHAPE[1]


def random_model(seed: int) -> tuple[np.ndarray, PixelModel]:
    """Light, and a sensor each of whose parts is there or not."""
    rng = np.random.default_rng(seed)

    def around(mean: float) -> np.ndarray:
        return rng.normal(mean, 0.1 * abs(mean) + 0.1, SHAPE).clip(0).astype(np.float32)

    def some(value: object) -> object:
        return value if rng.random() < 0.6 else None

    places = np.sort(rng.choice(PIXELS, 30))  # some twice
    columns = np.sort(rng.choice(SHAPE[1] - 2, 20, replace=False)) + 1
    parts = {
        "response": some(around(1)),
        "dark_share": some(around(1)),
        "pattern": some(rng.normal(0, 3, SHAPE).astype(np.float32)),
        "noise": some(FrameNoise([seed, 1])),
        "hot": some(places),
        "gain": some(rng.uniform(0.2, 3, (2, SHAPE[1])).astype(np.float32)),
        "repaired": some(columns + SHAPE[1] * int(rng.integers(SHAPE[0]))),
        "stuck": some(rng.choice(PIXELS, 9)),
        "black": some(20.0),
    }
    model = PixelModel(**{name: one for name, one in parts.items() if one is not None})
    model = replace(
        model,
        dark=float(rng.uniform(0, 40)),
        hot_charge=rng.exponential(500, len(model.hot)).astype(np.float32),
        shot=float(rng.uniform(0, 2)),
        shot_of_light=model.response is not None or bool(rng.integers(2)),
        steady=float(rng.uniform(0.1, 200)),
        offset=float(rng.uniform(-5, 40)),
        **[{}, {"full_scale": 4095, "step": 1 / 16}, {"full_scale": 1023, "step": 0.25}][seed % 3],
    )
    return (rng.exponential(300, SHAPE)).astype(np.float32), model


@needs_compiler
@pytest.mark.parametrize("seed", range(12))
def test_grey_values_are_equal(seed: int) -> None:
    light, model = random_model(seed)
    before = light.copy()
    expected = pixels.reference(light, model)
    assert len(np.unique(expected)) > 10
    np.testing.assert_array_equal(pixels.compiled(library.light_library(), light, model), expected)
    np.testing.assert_array_equal(light, before)


@needs_compiler
@together("step", [1 / 16, 0.25, 1.0])
@together("gain", [0.3, 1.0, np.array([[1.0, 1.02]])])
@together("shot_of_light", [False, True])
@together("steady", [0.3, 20.0])
def test_grey_values_of_a_dark_sky_are_equal(
    steady: float, shot_of_light: bool, gain: float | np.ndarray, step: float
) -> None:
    shape = (301, 1008)  # whole segments
    rng = np.random.default_rng(round(100 * steady))
    light = 10 ** rng.uniform(-7, 3, (shape[0], 64)).astype(np.float32)
    light = np.repeat(light, 16, axis=1)[:, : shape[1]].copy()  # as large as a segment
    light[rng.random(shape) < 0.3] = 0
    repaired = shape[1] * rng.choice(shape[0], 100, replace=False) + rng.integers(1, 1000, 100)
    model = PixelModel(
        noise=FrameNoise([7]),
        hot=np.sort(rng.choice(shape[0] * shape[1], 200)),
        hot_charge=np.full(200, 50, np.float32),
        repaired=np.sort(repaired),
        dark=12.0,
        black=9.0,
        shot=0.5,
        shot_of_light=shot_of_light,
        steady=steady,
        gain=np.tile(gain, 504)[:, : shape[1]] if isinstance(gain, np.ndarray) else gain,
        offset=8.0,
        full_scale=4095 if step < 0.1 else 1023 if step < 1 else 255,
        step=step,
    )
    expected = pixels.reference(light, model)
    np.testing.assert_array_equal(pixels.compiled(library.light_library(), light, model), expected)


@needs_compiler
@together("odd", [*Most._fields, "gain"])
@together("black", [0.0, 20.0])
@together("dark", [1.0, 20.0])
def test_black_segments_are_equal(dark: float, black: float, odd: str) -> None:
    """A few pixels differ much from the others, so that a bound of those is wrong there."""
    shape = (301, 1008)  # whole segments
    rng = np.random.default_rng(7)
    light = np.where(rng.random(shape) < 0.05, rng.exponential(60, shape), 0).astype(np.float32)
    light = np.where(rng.random(shape) < 0.01, 40 * light, light)
    light[:, 500:] = 0
    fields = {name: np.full(shape, name != "pattern", np.float32) for name in Most._fields}
    fields["gain"] = np.full((2, shape[1]), 0.4, np.float32)
    differing = rng.choice(fields[odd].size, fields[odd].size // 300)
    fields[odd].reshape(-1)[differing] = rng.choice([-3, 8], len(differing))
    if odd != "pattern":
        np.abs(fields[odd], out=fields[odd])
    most = Most.of(*(fields[name] for name in Most._fields))
    model = PixelModel(
        **fields,
        most=most,
        noise=FrameNoise([7]),
        dark=dark,
        black=black,
        steady=100.0,
        full_scale=4095,
        step=1 / 16,
        hot=np.sort(rng.choice(light.size, 200)),
        hot_charge=np.full(200, 500, np.float32),
    )
    expected = pixels.reference(light, model)
    assert 100 < np.count_nonzero(expected) < light.size / 5
    np.testing.assert_array_equal(pixels.compiled(library.light_library(), light, model), expected)


@together("light", [0.0, 1.0])
@together("dark", [0.0, 10.0, 30.0])
@together("black", [0.0, 10.0])
@together("gain", [0.1, 1.0, 2.0])
def test_grey_values_of_dim_pixels_are_known_from_their_numbers(
    gain: float, black: float, dark: float, light: float
) -> None:
    """Each that is known is right, at both ends of its numbers, and few are unknown."""
    model = PixelModel(
        noise=FrameNoise([1]), dark=dark, black=black, gain=gain, steady=4.0, offset=10.0, step=0.25
    )
    table = pixels._dim_values_of(model, np.full((2, 4), gain, np.float32))
    assert table is not None
    unused = 32 - pixels.TABLE_BITS
    words = (np.arange(len(table), dtype=np.uint32) << np.uint32(unused)).repeat(2)
    words[1::2] |= np.uint32((1 << unused) - 1)

    class Words(FrameNoise):
        def words(self, first: int, count: int) -> np.ndarray:
            return words[first : first + count]

    given = np.full((1, len(words)), light * pixels._dim_light(model), np.float32)
    grey = pixels.reference(given, replace(model, noise=Words([1])))[0]
    found = table.repeat(2)
    known = found != pixels.UNKNOWN
    np.testing.assert_array_equal(found[known], grey[known])
    assert known.mean() > 0.98


@needs_compiler
@pytest.mark.parametrize("rows", [(0, 1), (1, 4), (170, 301)])
def test_rows_do_not_depend_on_which_others_are_computed(rows: tuple[int, int]) -> None:
    for seed in range(3):
        light, model = random_model(seed)
        some = pixels.compiled(library.light_library(), light, model, rows)
        np.testing.assert_array_equal(some, pixels.reference(light, model)[slice(*rows)])


@needs_compiler
@pytest.mark.parametrize("sigma_px", [0.4, 1.5, 6.0, 20.0])
def test_spots_are_equal(sigma_px: float, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(int(10 * sigma_px))
    places = rng.uniform(-30, (1030, 330), (300, 2))
    places[:5], places[5:9] = np.rint(places[:5]), np.nan
    charge = rng.exponential(1e4, 300)
    found = spots.spots(places, charge, sigma_px, SHAPE)
    monkeypatch.setattr(spots, "light_library", lambda: None)
    monkeypatch.setattr(spots, "CELLS_AT_ONCE", 1_000_000)
    expected = spots.spots(places, charge, sigma_px, SHAPE)
    assert expected.max() > 0
    np.testing.assert_array_equal(found, expected)


@needs_compiler
@pytest.mark.parametrize("seed", range(6))
def test_points_without_distortion_are_equal(seed: int) -> None:
    """Some of the points have none: the strongest lenses fold the picture."""
    rng = np.random.default_rng(seed)
    lens = Brown(*rng.normal(0, 0.1 * seed, 4))
    targets = rng.uniform(-0.9, 0.9, (3001, 2))
    expected = lens.reference(targets)
    np.testing.assert_array_equal(lens.compiled(library.light_library(), targets), expected)
    found = np.isfinite(expected).all(axis=1)
    assert found.sum() > 300
    np.testing.assert_allclose(lens.of(expected[found]), targets[found], atol=1e-12)


@needs_compiler
@pytest.mark.parametrize("seed", range(6))
def test_displacements_by_a_lens_are_equal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = np.array([0.0, *np.sort(rng.uniform(5, 90, seed)), 95.0])
    values = np.array([0.0, *rng.normal(0, 1, seed), 0.0])
    lens = LensCurve(nodes, values, *rng.normal(0, 0.1, 2))
    x, y = rng.uniform(-100, 100, (2, 5001))
    x[:40], y[:30], y[30:40] = np.resize(nodes, 40), 0, -0.0  # on the nodes
    expected = lens.reference(x, y)
    found = lens.compiled(library.light_library(), x, y)
    np.testing.assert_array_equal(np.stack(found), np.stack(expected))
    assert (found[0] != x).mean() > 0.5
    some = lens.displaced(x[:7], y[:7])  # few points, without the library
    np.testing.assert_array_equal(np.stack(some), np.stack(expected)[:, :7])


@needs_compiler
@together("glow", [0.0, 0.0016])
@together("unevenness", [0.0, 0.03, 0.6])
@together("distance", [1.03, 1.12, 6.6])
def test_globes_are_equal(distance: float, unevenness: float, glow: float) -> None:
    rng = np.random.default_rng(int(100 * distance))
    vectors = rng.normal((0, 0, 1), 1, (5003, 3))
    centre, sun = rng.normal((0, 0, 2), 1, (2, 3))
    waves = rng.standard_normal((16, 3)) * 5
    vectors, (centre, sun) = (unit(one) for one in (vectors, np.stack([centre, sun])))
    body = globe.Globe(distance, centre, -sun, 0.05, glow, 8.0, waves, rng.random(16), unevenness)
    pixel_rad = rng.uniform(0.002, 0.02, len(vectors)).astype(np.float32)
    sight = vectors.astype(np.float32)
    hit, light = globe.reference(sight, pixel_rad, body)
    assert 30 < len(hit) < len(vectors)
    found = globe.compiled(library.light_library(), sight, pixel_rad, body)
    np.testing.assert_array_equal(found[0], hit)
    np.testing.assert_array_equal(found[1], light)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_cosine_and_exponential_function_are_accurate() -> None:
    x = np.linspace(-30, 0, 100_001).astype(np.float32)
    np.testing.assert_allclose(globe._cosine(x), np.cos(2 * np.pi * x.astype(float)), atol=1e-6)
    np.testing.assert_allclose(globe._exp(x), np.exp(x.astype(float)), rtol=3e-6)


def test_no_spots_leave_the_sensor_dark() -> None:
    assert not spots.spots(np.zeros((0, 2)), np.zeros(0), 1.0, SHAPE).any()


def test_without_a_compiler_numpy_is_used_and_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    light, model = random_model(1)
    monkeypatch.setattr(compiler, "find_compiler", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(library, "_library", None)
    line = "^no C.. compiler found .*; inner loops run in Python"
    with pytest.warns(UserWarning, match=line) as warned:
        grey = pixels.grey_values(light, model)
    assert len(warned) == 1
    np.testing.assert_array_equal(grey, pixels.reference(light, model))


def test_a_wheel_has_the_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "_library", None)
    with collected() as wanted, pytest.warns(UserWarning, match="only listed"):
        Mlx75412(SkyScene.pointing(0.0, 0.0))
    assert [one.title for one in wanted] == [library.TITLE]
