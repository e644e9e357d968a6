"""The cause of a bad image is identified by its traces."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.detection.mask import LevelHistory
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED, Configuration, solve
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason

from .sky import FIELD, database, meter

Y, X = np.mgrid[: FIELD.rows, : FIELD.columns]


def picture(level: object, seed: int = 0) -> NDArray[np.uint8]:
    image = np.random.default_rng(seed).normal(0, 1.5, Y.shape) + level
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def reason(image: NDArray[np.uint8], configuration: Configuration = VERIFIED) -> Reason:
    solution = solve(image, LevelHistory(), configuration, database(), meter())
    assert solution.outcome is MeasurementOutcome.NONE
    return solution.reason


def hit(count: int) -> NDArray[np.uint8]:
    image = picture(6.0)
    image.ravel()[np.random.default_rng(1).choice(image.size, count, replace=False)] = 255
    return image


@pytest.mark.parametrize(
    ("image", "expected"),
    [
        (picture(6.0), Reason.TOO_FEW_STARS),
        (picture(60.0), Reason.STRAY_LIGHT),
        (picture(6 + 0.03 * X), Reason.STRAY_LIGHT),
        (picture(6 + 300.0 * (Y < 300)), Reason.SATURATED),
        (picture(6 + 300.0 * (np.hypot(X - 640, Y - 500) < 60)), Reason.SATURATED),
        (hit(2000), Reason.RADIATION),
    ],
    ids=["dark", "bright", "gradient", "limb", "disc", "hits"],
)
def test_the_reason_is_true(image: NDArray[np.uint8], expected: Reason) -> None:
    assert reason(image) is expected


def test_a_picture_full_of_hits_is_not_even_tried() -> None:
    spent = meter()
    solution = solve(hit(60_000), LevelHistory(), VERIFIED, database(), spent)
    assert solution.reason is Reason.RADIATION
    assert "triangles" not in spent.phases


def test_as_published_there_are_no_such_reasons() -> None:
    assert reason(hit(2000), PUBLISHED) is Reason.TOO_FEW_STARS
