from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude import geometry
from cubestack.firmware_model.attitude.covariance import covariance
from cubestack.firmware_model.attitude.field_of_view import field_of_view
from cubestack.firmware_model.attitude.quest import dcm, quest
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker import confirmation

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


@pytest.mark.parametrize("count", [4, 13])
@pytest.mark.parametrize("name", CASES)
def test_charges(name: str, count: int) -> None:
    meter = Meter(CORTEX_M3)
    CASES[name](count, meter)
    as_on_record(f"attitude: {name}, {count} stars", meter)
