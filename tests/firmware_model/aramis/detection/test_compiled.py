"""The compiled loops equal the Python form, in results and charges."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.aramis.detection.mask import LevelHistory, SpikeRemoval, remove_spikes
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.pipeline import (
    VERIFIED,
    DetectionSettings,
    detect,
    detect_locally,
)
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import Meter
from tests.firmware_model.compiled import assert_equal_forms
from tests.tiers import quick

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")

SEEDS = st.integers(0, 2**32 - 1)
FIELD = CameraField(columns=160, rows=128, pitch_x_mm=0.0416, pitch_y_mm=0.0416)


@given(
    SEEDS, st.integers(1, 40), st.integers(1, 60), st.floats(0, 1), st.sampled_from(SpikeRemoval),
    st.integers(0, 30),
)  # fmt: skip
def test_spikes(
    seed: int, rows: int, columns: int, share: float, method: SpikeRemoval, needed: int
) -> None:
    mask = np.random.default_rng(seed).random((rows, columns)) < share
    assert_equal_forms(lambda _: remove_spikes(mask, method, needed), BLACKFIN_BF533)


def sky(seed: int, kind: str) -> np.ndarray:
    """A picture of FIELD's size: stars on noise, or what drives a limit."""
    rng = np.random.default_rng(seed)
    image = rng.normal(rng.uniform(2, 60), rng.uniform(0.1, 6), (FIELD.rows, FIELD.columns))
    y, x = np.mgrid[: FIELD.rows, : FIELD.columns]
    for _ in range({"stars": 12, "many": 60}.get(kind, 0)):
        at_y, at_x = rng.uniform(0, FIELD.rows), rng.uniform(0, FIELD.columns)
        spread = rng.uniform(0.6, 3)
        light = rng.uniform(20, 900)
        image += light * np.exp(-((y - at_y) ** 2 + (x - at_x) ** 2) / (2 * spread**2))
    if kind == "moon":
        image += 400 * ((y - 60) ** 2 + (x - 90) ** 2 < 30**2) + 0.2 * x
    if kind == "saturated":
        image += 300
    return np.clip(np.rint(image), 0, 255 if kind != "empty" else 0).astype(np.uint8)


KINDS = ["stars", "many", "noise", "moon", "saturated", "empty"]


@pytest.mark.parametrize(("kind", "method"), quick(product(KINDS, SpikeRemoval), 6))
@settings(max_examples=4)
@given(seed=SEEDS)
def test_whole_search_with_one_threshold(seed: int, kind: str, method: SpikeRemoval) -> None:
    def compute(meter: Meter) -> object:
        background, chosen = LevelHistory(), DetectionSettings(spikes=method, sigmas=seed % 5)
        turns = [sky(seed + n, kind) for n in range(2)]
        return [detect(one, background, FIELD, chosen, meter) for one in turns]

    assert_equal_forms(compute, BLACKFIN_BF533)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=8)
@given(seed=SEEDS)
def test_whole_search_above_the_local_background(seed: int, kind: str) -> None:
    picture = sky(seed, kind)
    assert_equal_forms(
        lambda meter: detect_locally(picture, FIELD, VERIFIED.detection, meter), BLACKFIN_BF533
    )
