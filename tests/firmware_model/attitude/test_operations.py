"""What the attitude's routines are charged: of a few stars, and of many."""

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
from ..registry import registered_in

Floats = NDArray[np.float32]
Case = Callable[[int, Meter], object]
CASES: dict[str, Case] = {}
case = registered_in(CASES)

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


@case("quest")
def _(count: int, meter: Meter) -> None:
    quest(*seen(count), np.ones(count, np.float32), meter)


@case("dcm")
def _(count: int, meter: Meter) -> None:
    for _ in range(count):
        dcm(np.array([0, 0, 0, 1], np.float32), meter)


@case("covariance")
def _(count: int, meter: Meter) -> None:
    covariance(seen(count)[0], sigmas(count), sigmas(count), meter)


@case("robust fit")
def _(count: int, meter: Meter) -> None:
    robust_fit(*seen(count), sigmas(count), meter, scale=1.0, excess=1.0)


@case("robust fit of another focal length")
def _(count: int, meter: Meter) -> None:
    robust_fit(*seen(count), sigmas(count), meter, scale=1.001, excess=1.0)


@case("matched")
def _(count: int, meter: Meter) -> None:
    measured, _ = seen(count)
    confirmation.matched(measured, measured[::2], 1e-3, meter)


@case("false alarm")
def _(count: int, meter: Meter) -> None:
    confirmation.false_alarm(1.0, count, count // 2, 1e-3, meter)


@case("scaled")
def _(count: int, meter: Meter) -> None:
    geometry.scaled(seen(count)[0], 1.01, meter)


@case("correction")
def _(count: int, meter: Meter) -> None:
    measured, _ = seen(count)
    confirmation.correction(measured, measured, meter, with_scale=False)


@case("correction with scale")
def _(count: int, meter: Meter) -> None:
    measured, _ = seen(count)
    confirmation.correction(measured, measured, meter, with_scale=True)


@case("from three")
def _(count: int, meter: Meter) -> None:
    measured, reference = seen(count)
    confirmation.from_three(measured[:3], reference[:3], meter)


@case("undistort")
def _(count: int, meter: Meter) -> None:
    geometry.undistort(np.full((count, 2), 300, np.float32), CAMERA, meter)


@case("unit vectors")
def _(count: int, meter: Meter) -> None:
    geometry.unit_vectors(np.full((count, 2), 300, np.float32), CAMERA, meter)


@case("direction of")
def _(count: int, meter: Meter) -> None:
    geometry.direction_of(1.0, 0.5, meter)


@case("angles of")
def _(count: int, meter: Meter) -> None:
    geometry.angles_of(seen(count)[0][0], meter)


@case("field")
def _(count: int, meter: Meter) -> None:
    FIELD.contains(seen(count)[0], meter)


@case("field with blind cells")
def _(count: int, meter: Meter) -> None:
    FIELD.without(np.eye(4, dtype=np.bool_)).contains(seen(count)[0], meter)


FIELD = field_of_view(CAMERA, 1024, 512)


@pytest.mark.parametrize("count", [4, 13])
@pytest.mark.parametrize("name", CASES)
def test_charges(name: str, count: int) -> None:
    meter = Meter(CORTEX_M3)
    CASES[name](count, meter)
    as_on_record(f"attitude: {name}, {count} stars", meter)
