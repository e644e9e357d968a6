"""A range of the k-vector is what comparing every value gives, for less work."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue.kvector import KVector

from ..sky import database, meter

Values = NDArray[np.float32]


def brute_force(rising: Values, low: np.float32, high: np.float32) -> list[int]:
    return np.flatnonzero((rising >= low) & (rising <= high)).tolist()


def found(rising: Values, low: float, high: float, per_bin: int = 4) -> list[int]:
    vector = KVector.build(rising, per_bin)
    places = vector.find(rising, np.float32(low), np.float32(high), meter())
    return list(range(places.start, places.stop))


floats = st.floats(-1e6, 1e6, width=32)


@example([0.0, 1e-45], 0.0, 0.0, 1)
@example([7.0] * 50, 7.0, 7.0, 4)
@given(st.lists(floats, min_size=1, max_size=200), floats, floats, st.integers(1, 30))
@settings(max_examples=300, deadline=None)
def test_any_list_and_any_range(values: list[float], a: float, b: float, per_bin: int) -> None:
    rising = np.sort(np.array(values, dtype=np.float32))
    low, high = np.float32(min(a, b)), np.float32(max(a, b))
    assert found(rising, float(low), float(high), per_bin) == brute_force(rising, low, high)


@given(st.lists(floats, min_size=1, max_size=60), st.data())
@settings(max_examples=200, deadline=None)
def test_bounds_that_are_values_themselves_count(values: list[float], data: st.DataObject) -> None:
    rising = np.sort(np.array(values, dtype=np.float32))
    value = st.sampled_from(rising.tolist())
    low, high = sorted((data.draw(value), data.draw(value)))
    assert found(rising, low, high) == brute_force(rising, np.float32(low), np.float32(high))


@pytest.mark.parametrize("name", ["area", "moment"])
def test_the_real_lists_against_brute_force(name: str) -> None:
    onboard, rng = database(), np.random.default_rng(4)
    rising, vector = getattr(onboard, f"{name}s"), getattr(onboard, f"{name}_index")
    looked_at = []
    for _ in range(300):
        middle = rising[rng.integers(len(rising))]
        width = np.float32(middle * rng.uniform(0, 0.02))
        low, high = np.float32(middle - width), np.float32(middle + width)
        places = vector.find(rising, low, high, meter())
        start, stop = np.searchsorted(rising, low), np.searchsorted(rising, high, side="right")
        assert (places.start, places.stop) == (start, stop)
        assert places.looked_at >= len(places)
        looked_at.append(places.looked_at - len(places))
    assert max(looked_at) < 0.001 * len(rising)


@pytest.mark.parametrize(
    ("low", "high"), [(2.0, 1.0), (5.0, 6.0), (-2.0, -1.0), (np.nan, 1.0), (0.0, np.nan)]
)
def test_empty_ranges(low: float, high: float) -> None:
    assert found(np.array([0, 1, 2, 3], dtype=np.float32), low, high) == []


def test_each_comparison_is_charged() -> None:
    rising = np.arange(1000, dtype=np.float32)
    vector = KVector.build(rising, 10)
    spent = meter()
    places = vector.find(rising, np.float32(500), np.float32(520), spent)
    trimmed = places.looked_at - len(places)
    assert (spent.counts["loop"], spent.counts["f32_mul"]) == (trimmed + 2, 6)
