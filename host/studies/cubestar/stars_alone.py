"""Identification by profile `extended` alone: how often it is right on centroids of random skies,
and how often it accepts centroids that are no stars."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.attitude.geometry import scaled, undistort, unit_vectors
from cubestack.firmware_model.cubestar.matching.confirmed import PASSES, identify
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.search import MatchOutcome
from cubestack.host.experiments.attitude import is_right
from cubestack.host.studies.cubestar.identification import (
    CAMERA,
    CATALOGUE,
    FIELD,
    Centroids,
    picture,
)
from cubestack.host.studies.rows.estimate import average, rate, rate_of
from cubestack.host.studies.rows.trial import Figures

Rays = NDArray[np.float32]
Attitude = NDArray[np.float64]

SKIES: dict[str, dict[str, Any]] = {
    **{f"V < 3.8, {n} false stars": {"false": n} for n in (0, 5, 10, 20)},
    "uncut sky": {"uncut": True},
    "mirrored": {"mirrored": True},
}
"""Arguments of ``picture``."""

SEED = 1

COUNTS = (3, 4, 5, 8, 12, 20, 40)
"""Of random centroids."""

CLAIMS = (1.0, 0.1, 0.01, 0.001)
"""Limits of false alarms per image."""

NO_LIMIT_S = 1e6


def pictures(sky: str, count: int, seed: int = SEED) -> Iterator[Centroids]:
    rng = np.random.default_rng([seed, list(SKIES).index(sky)])
    for _ in range(count):
        yield picture(rng, **{"false": 0, "uncut": False, "mirrored": False, **SKIES[sky]})


def attitude_of(rays: Rays, meter: Meter) -> Attitude | None:
    """The fit with equal weights to the stars that are identified among unit vectors (n, 3)."""
    found = identify(rays, None, CATALOGUE, FIELD, meter)
    named = found.matched
    if not len(named):
        return None
    measured = scaled(rays, 1 / found.scale, meter)[named]
    turn, _ = Rotation.align_vectors(measured, CATALOGUE.vectors[found.stars[named]])
    return np.asarray(turn.as_matrix())


def wrong_by(found: Attitude, truth: Attitude) -> tuple[float, float]:
    """Errors across and about the boresight, in degrees."""
    off = found @ truth.T
    roll = np.arctan2(off[0, 1] - off[1, 0], off[0, 0] + off[1, 1])
    return float(np.degrees(np.arccos(min(off[2, 2], 1.0)))), float(np.degrees(roll))


def identification(_opened: object, frames: int) -> Figures:
    """Of each sky: % right, of all and with four listed stars, wrong ones, ms of the processor."""
    offer_firmware_loops()
    figures = dict[str, float]()
    for sky, how in SKIES.items():
        right, enough, wrong, spent = list[bool](), list[bool](), 0, list[float]()
        for each in pictures(sky, frames):
            meter = Meter(CORTEX_M3)
            found = attitude_of(each.rays, meter)
            good = found is not None and is_right(*wrong_by(found, each.attitude))
            good = good and not how.get("mirrored", False)
            right.append(good)
            enough += [good] if each.listed > 3 else []
            wrong += found is not None and not good
            spent.append(1000 * meter.table.seconds(meter.total))
        figures |= {f"{sky}, right": rate(right), f"{sky}, of four": rate(enough)}
        figures |= {f"{sky}, wrong": wrong, f"{sky}, ms": average(spent)}
        figures[f"{sky}, most ms"] = max(spent)
    return figures


def false_alarms(_opened: object, frames: int) -> Figures:
    """% of images of random centroids that the first search accepts with each limit, and how many
    of all; every other image has no stars in the left part."""
    offer_firmware_loops()
    rng, accepted = np.random.default_rng(SEED), dict.fromkeys(CLAIMS, 0)
    cells = np.zeros((8, 16), bool)
    cells[:, :5] = True
    fields, firsts = (FIELD, FIELD.without(cells)), (0, LENS.columns * 5 / 16)
    meter = Meter(CORTEX_M3)
    for number in range(frames):
        field, first = fields[number % 2], firsts[number % 2]
        for count in COUNTS:
            last = (LENS.columns - 1, LENS.rows - 1)
            pixels = rng.uniform((first, 0), last, (count, 2)).astype(np.float32)
            rays = unit_vectors(undistort(pixels, CAMERA, meter), CAMERA, meter)
            for claim in CLAIMS:
                outcome = identify(
                    *(rays, None, CATALOGUE, field, meter),
                    limit_s=NO_LIMIT_S,
                    largest_false_alarm=claim,
                    passes=PASSES[:1],
                ).outcome
                accepted[claim] += outcome is MatchOutcome.IDENTIFIED
                if outcome not in (MatchOutcome.IDENTIFIED, MatchOutcome.AMBIGUOUS):
                    break  # a lower limit accepts no more
    images = frames * len(COUNTS)
    return {
        "images": images,
        **{f"{claim:g}": rate_of(number, images) for claim, number in accepted.items()},
        **{f"{claim:g}, number": number for claim, number in accepted.items()},
    }
