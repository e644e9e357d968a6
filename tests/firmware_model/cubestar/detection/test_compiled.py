"""The compiled loops equal the Python form, in results and charges."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.cubestar.detection import (
    Detection,
    DetectionConfig,
    SearchEnd,
    detect_stars,
)
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from tests.firmware_model.compiled import assert_equal_forms

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")

SEEDS = st.integers(0, 2**32 - 1)
KINDS = ["stars", "many", "noise", "moon", "saturated", "empty"]


def sky(seed: int, kind: str) -> np.ndarray:
    """Part of a picture: stars on noise, or what drives a limit."""
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(40, 130, 2)
    image = rng.normal(rng.uniform(0, 60), rng.uniform(0.1, 6), (rows, columns))
    y, x = np.mgrid[:rows, :columns]
    for _ in range({"stars": 9, "many": 80}.get(kind, 0)):
        at_y, at_x = rng.uniform(0, rows), rng.uniform(0, columns)
        spread = rng.uniform(0.5, 2)
        light = rng.uniform(10, 500)
        image += light * np.exp(-((y - at_y) ** 2 + (x - at_x) ** 2) / (2 * spread**2))
    if kind == "moon":
        image += 300 * ((y - 30) ** 2 + (x - 60) ** 2 < 25**2) + rng.uniform(0, 1) * x
    if kind == "saturated":
        image += 300
    top = 0 if kind == "empty" else 255
    return np.clip(np.rint(image), 0, top).astype(np.uint8)


def searched(seed: int, kind: str, **chosen: Any) -> Detection:
    picture = sky(seed, kind)
    rng = np.random.default_rng(seed)
    rows, columns = picture.shape
    config = DetectionConfig(
        x_start=int(rng.integers(0, 10)),
        x_end=columns - int(rng.integers(0, 10)),
        y_start=int(rng.integers(0, 10)),
        y_end=rows - int(rng.integers(0, 10)),
        **chosen,
    )
    found = assert_equal_forms(lambda meter: detect_stars(picture, config, meter), CORTEX_M3)
    assert isinstance(found, Detection)
    return found


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12)
@given(seed=SEEDS, data=st.data())
def test_sampled_search(seed: int, kind: str, data: st.DataObject) -> None:
    least = data.draw(st.integers(1, 12))
    searched(
        seed,
        kind,
        step=data.draw(st.integers(1, 7)),
        detection_threshold=data.draw(st.integers(0, 255)),
        star_threshold=data.draw(st.integers(0, 80)),
        min_pixels=least,
        max_pixels=data.draw(st.integers(least, 255)),
        grid_size=data.draw(st.sampled_from([1, 3, 5, 9, 255])),
        max_stars=data.draw(st.integers(1, 30)),
        max_invalid=data.draw(st.integers(0, 60)),
        max_noise=data.draw(st.integers(0, 255)),
        plain_weights=data.draw(st.booleans()),
    )


@pytest.mark.parametrize(
    ("kind", "end", "chosen"),
    [
        ("many", SearchEnd.STARS, {"max_stars": 2, "min_pixels": 1}),
        ("saturated", SearchEnd.INVALID, {"max_invalid": 3}),
        ("stars", SearchEnd.NOISE, {"max_noise": 1, "min_pixels": 255, "max_pixels": 255}),
        ("empty", SearchEnd.COMPLETE, {}),
    ],
)  # fmt: skip
def test_sampled_search_ends_alike(kind: str, end: SearchEnd, chosen: dict[str, int]) -> None:
    ends = {searched(seed, kind, **chosen).end for seed in range(6)}
    assert end in ends


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=10)
@given(seed=SEEDS, threshold=st.integers(0, 60), most=st.integers(1, 40))
def test_background_search(seed: int, kind: str, threshold: int, most: int) -> None:
    searched(seed, kind, background=True, star_threshold=threshold, max_stars=most)
