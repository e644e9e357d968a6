"""The charge of each further star equals the operations that counting arrays record."""

from collections import Counter
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

from cubestack.firmware_model.attitude import geometry
from cubestack.firmware_model.attitude.covariance import information
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

from .test_operations import CAMERA, FIELD, seen, sigmas

KINDS = {
    "add": "f32_add", "subtract": "f32_add", "multiply": "f32_mul", "divide": "f32_div",
    "true_divide": "f32_div", "sqrt": "f32_sqrt", "negative": "", "square": "f32_mul",
    "greater_equal": "f32_compare", "less_equal": "f32_compare", "bitwise_and": "",
}  # fmt: skip


class Counted(np.ndarray[Any, np.dtype[np.float32]]):
    """An array of which each number counts what is done to it."""

    done: ClassVar[Counter[str]] = Counter()

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **how: Any) -> Any:
        plain = [np.asarray(one) for one in inputs]
        if "out" in how:
            how["out"] = tuple(np.asarray(one) for one in how["out"])
        result = getattr(ufunc, method)(*plain, **how)
        if ufunc is np.matmul:
            sums = plain[0].shape[-1]
            Counted.done["f32_mul"] += result.size * sums
            Counted.done["f32_add"] += result.size * (sums - 1)
        elif method == "reduce":
            Counted.done[KINDS[ufunc.__name__]] += plain[0].size - np.size(result)
        else:
            Counted.done[KINDS[ufunc.__name__]] += np.size(result)
        return np.asarray(result).view(Counted)


Case = tuple[Callable[[Any, int, Meter], object], dict[str, int]]

#: Routines, and what their programs do otherwise than arrays.
CASES: dict[str, Case] = {
    "undistort": (lambda stars, _, meter: geometry.undistort(stars[:, :2], CAMERA, meter), {}),
    "unit vectors": (
        lambda stars, _, meter: geometry.unit_vectors(stars[:, :2], CAMERA, meter),
        {},
    ),
    "scaled": (
        lambda stars, _, meter: geometry.scaled(stars, 1.01, meter),
        {"f32_div": -2, "f32_mul": +2},  # once by the length, and three products; z is not scaled
    ),
    "information": (
        lambda stars, count, meter: information(stars, sigmas(count), meter),
        {"f32_mul": -3},  # the matrix is symmetric
    ),
    "field": (
        lambda stars, _, meter: FIELD.contains(stars, meter),
        {"f32_mul": -1},  # the factor is 1
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_further_star_is_charged_what_its_numbers_see(name: str) -> None:
    routine, otherwise = CASES[name]
    charged: Counter[str] = Counter()
    seen_by_them: Counter[str] = Counter()
    for count, sign in ((30, 1), (10, -1)):
        meter, stars = Meter(CORTEX_M3), seen(count)[0].view(Counted)
        Counted.done = Counter()
        routine(stars, count, meter)
        for kind in ("f32_add", "f32_mul", "f32_div", "f32_sqrt", "f32_compare"):
            charged[kind] += sign * meter.counts[kind]
            seen_by_them[kind] += sign * Counted.done[kind]
    for kind, count in charged.items():
        assert count == seen_by_them[kind] + 20 * otherwise.get(kind, 0), kind
