from collections import Counter
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude import geometry
from cubestack.firmware_model.attitude.covariance import covariance, information
from cubestack.firmware_model.attitude.field_of_view import field_of_view
from cubestack.firmware_model.attitude.quest import dcm, quest
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker import confirmation
from tests.together import together

from ..operations import as_on_record

Floats = NDArray[np.float32]

CAMERA = geometry.CameraParameters(6.28, 1147.5, 1147.4, 512, 256, 0.32, -0.12, -0.004, 0.006)


def seen(count: int) -> tuple[Floats, Floats]:
    """Measured and catalogue vectors (count, 3)."""
    rng = np.random.default_rng(count)
    points = np.column_stack([rng.uniform(-0.4, 0.4, (count, 2)), np.ones(count)])
    body = points / np.linalg.norm(points, axis=1)[:, None]
    truth = Rotation.random(rng=rng)
    noisy = body + 2e-5 * rng.standard_normal(body.shape)
    return noisy.astype(np.float32), truth.inv().apply(body).astype(np.float32)


def sigmas(count: int) -> Floats:
    return np.full(count, 2e-5, np.float32)


def points(count: int) -> Floats:
    return np.full((count, 2), 300, np.float32)


def measured(count: int) -> Floats:
    return seen(count)[0]


FIELD = field_of_view(CAMERA, 1024, 512)
BLIND = FIELD.without(np.eye(4, dtype=np.bool_))

CASES: dict[str, Callable[[int, Meter], object]] = {
    "quest": lambda n, meter: quest(*seen(n), np.ones(n, np.float32), meter),
    "dcm": lambda n, meter: [dcm(np.array([0, 0, 0, 1], np.float32), meter) for _ in range(n)],
    "covariance": lambda n, meter: covariance(measured(n), sigmas(n), sigmas(n), meter),
    "robust fit": lambda n, meter: robust_fit(*seen(n), sigmas(n), meter, scale=1.0, excess=1.0),
    "robust fit of another focal length": lambda n, meter: robust_fit(
        *seen(n), sigmas(n), meter, scale=1.001, excess=1.0
    ),
    "matched": lambda n, meter: confirmation.matched(measured(n), measured(n)[::2], 1e-3, meter),
    "false alarm": lambda n, meter: confirmation.false_alarm(1.0, n, n // 2, 1e-3, meter),
    "scaled": lambda n, meter: geometry.scaled(measured(n), 1.01, meter),
    "correction": lambda n, meter: confirmation.correction(
        measured(n), measured(n), meter, with_scale=False
    ),
    "correction with scale": lambda n, meter: confirmation.correction(
        measured(n), measured(n), meter, with_scale=True
    ),
    "from three": lambda n, meter: confirmation.from_three(
        *(vectors[:3] for vectors in seen(n)), meter
    ),
    "undistort": lambda n, meter: geometry.undistort(points(n), CAMERA, meter),
    "unit vectors": lambda n, meter: geometry.unit_vectors(points(n), CAMERA, meter),
    "direction of": lambda _, meter: geometry.direction_of(1.0, 0.5, meter),
    "angles of": lambda n, meter: geometry.angles_of(measured(n)[0], meter),
    "field": lambda n, meter: FIELD.contains(measured(n), meter),
    "field with blind cells": lambda n, meter: BLIND.contains(measured(n), meter),
}


@together("count", [4, 13])
@together("name", CASES)
def test_attitude_solvers_charge_the_recorded_operations(name: str, count: int) -> None:
    meter = Meter(CORTEX_M3)
    CASES[name](count, meter)
    as_on_record(f"attitude: {name}, {count} stars", meter)


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


COUNTED: dict[str, Callable[[Any, int, Meter], object]] = {
    "undistort": lambda stars, _, meter: geometry.undistort(stars[:, :2], CAMERA, meter),
    "unit vectors": lambda stars, _, meter: geometry.unit_vectors(stars[:, :2], CAMERA, meter),
    "scaled": lambda stars, _, meter: geometry.scaled(stars, 1.01, meter),
    "information": lambda stars, count, meter: information(stars, sigmas(count), meter),
    "field": lambda stars, _, meter: FIELD.contains(stars, meter),
}
#: What their programs do otherwise than arrays.
OTHERWISE = {
    "scaled": {"f32_div": -2, "f32_mul": +2},  # once by the length, three products; z is not scaled
    "information": {"f32_mul": -3},  # the matrix is symmetric
    "field": {"f32_mul": -1},  # the factor is 1
}


@pytest.mark.parametrize("name", COUNTED)
def test_each_further_star_charges_the_operations_it_needs(name: str) -> None:
    routine, otherwise = COUNTED[name], OTHERWISE.get(name, {})
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
