"""Body rate from the stars of two successive images, whatever their names: a stellar gyro.

Stars keep the angles between them while the camera turns. Two of one image and two of the next that
are as far apart, each near the place of its partner, support each other; the best supported pair
and all that agree with it are the first guess of the rotation. It predicts the other stars, and is
confirmed as an attitude is (``confirmation``). The rest is least squares with the weights of
``robust_fit``. A rolling shutter exposes a star that moved to another row at another time: such
measurements are carried to a common time with the first guess.

A direction s of the sky, in camera axes, follows s(t + T) = exp(-[w] T) s(t), w the body rate.
"""

from dataclasses import dataclass
from math import asin, radians

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import turned
from cubestack.firmware_model.attitude.quest import AttitudeError
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.attitude.vectors import cross
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.confirmation import (
    by_chance,
    correction,
    false_alarm,
    matched,
)
from cubestack.firmware_model.star_tracker.observation import LARGEST_FALSE_ALARM

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

#: Rate up to which stars are sought. Chosen: the spots of stars are drawn out at less.
LARGEST_RATE_DEG_S = 2.0

FEWEST_STARS = 2

MOST_PAIRS = 64  #: pairs of stars that may be the same; the nearest ones

#: How much residuals beyond the expected errors count: motion draws neighbouring stars out alike.
EXCESS = 2.2

#: The correction is linear: 0.1 rad leave 0.01, then 1e-4, then less than a float has.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class TimedStars:
    """Stars of an image."""

    directions: Floats  #: (n, 3) unit vectors in camera axes
    late_s: Floats  #: (n,) their mid-exposures, from the image's time on


@dataclass(frozen=True, eq=False)
class BodyRate:
    """A body rate about the camera's axes, the mean between two images, and its error."""

    rate_rad_s: Floats  #: (3,)
    covariance: Floats  #: (3, 3) of the rate's error, (rad/s)^2
    matched: int  #: stars that are in both images
    residual_rad: float  #: root mean square of their residuals in each axis
    false_alarm: float  #: expected number of wrong rotations that are confirmed as well


def rate_between(
    before: TimedStars,
    now: TimedStars,
    sigmas: Floats,
    apart_s: float,
    meter: Meter,
    *,
    margin_rad: float,
    solid_angle_sr: float,
) -> BodyRate | None:
    """The rate between two images ``apart_s`` apart, or None if their stars do not show one.

    Args:
        sigmas: (m,) expected errors in rad of the directions ``now``, in each axis; those before
            are believed to have the same.
        margin_rad: largest difference between two measured angles.
        solid_angle_sr: of an image.
    """
    reach = radians(LARGEST_RATE_DEG_S) * apart_s
    pairs = _supported(before.directions, now.directions, reach, margin_rad, meter)
    if len(pairs) < FEWEST_STARS:
        return None
    turn = _rotation(before, now, pairs, apart_s, meter)
    predicted = turned(before.directions, turn)
    meter.charge(f32_mul=9 * len(predicted), f32_add=6 * len(predicted))
    here, there, _ = matched(now.directions, predicted, margin_rad, meter)
    if len(here) < FEWEST_STARS:
        return None
    stars = len(predicted), len(now.directions)
    odds = _odds(len(here), *stars, reach, margin_rad, solid_angle_sr, meter)
    if odds > LARGEST_FALSE_ALARM:
        return None
    pairs = np.stack((there, here), axis=1)
    turn = _rotation(before, now, pairs, apart_s, meter)
    measured = _in_time(before, now, pairs, _vector(turn), apart_s, meter)
    believed = np.asarray(sigmas[here] * np.float32(2**0.5), np.float32)
    try:
        fit = robust_fit(
            measured, before.directions[there], believed, meter, scale=1.0, excess=EXCESS
        )
    except AttitudeError:
        return None
    *axis, _ = map(float, fit.quaternion)
    sine = float(np.linalg.norm(axis))
    factor = np.float32(-2 * (asin(min(sine, 1.0)) / sine if sine else 1.0) / apart_s)
    freedom = max(2 * len(here) - 3, 1)
    meter.charge(f32_mul=15, f32_add=2, f32_sqrt=2, f32_atan2=1, f32_div=4)
    return BodyRate(
        rate_rad_s=np.asarray(axis, np.float32) * factor,
        covariance=fit.covariance / np.float32(apart_s) ** 2,
        matched=len(here),
        residual_rad=float(np.sqrt(np.sum(fit.residuals**2) / freedom)),
        false_alarm=odds,
    )


def _supported(
    before: Floats, now: Floats, reach_rad: float, margin_rad: float, meter: Meter
) -> Indices:
    """Rows (k, 2) of ``before`` and ``now`` that may be the same star: the pair that most others
    support, and those that agree with it and with each other; each star once."""
    compared = len(before) * len(now)
    meter.charge(f32_mul=3 * compared, f32_add=5 * compared, f32_compare=compared, loop=compared)
    if not compared:
        return np.zeros((0, 2), np.intp)
    apart = now[None, :, :] - before[:, None, :]
    chord2 = np.sum(apart * apart, axis=2)
    nearest = np.argsort(chord2, axis=None, kind="stable")[:MOST_PAIRS]
    one, other = np.divmod(nearest[chord2.ravel()[nearest] <= reach_rad**2], len(now))
    tried = len(one) * max(len(one) - 1, 0) // 2
    meter.charge(
        ram_read=4 * tried,
        f32_mul=6 * tried,
        f32_add=11 * tried,
        f32_sqrt=2 * tried,
        f32_compare=tried,
        loop=tried,
    )
    agree = np.abs(_sides(before[one]) - _sides(now[other])) <= margin_rad
    agree &= (one[:, None] != one) & (other[:, None] != other)
    votes = agree.sum(axis=1)
    if not votes.any():
        return np.zeros((0, 2), np.intp)
    best = int(np.argmax(votes))
    others = np.flatnonzero(agree[best])
    group = [best, *others[np.argsort(-votes[others], kind="stable")]]
    meter.charge(i32_add=len(one), ram_read=2 * len(one), loop=len(one) + len(group) ** 2)
    chosen = list[int]()
    for at in group:  # a pair agrees with none that has one of its stars
        if agree[at, chosen].all():
            chosen.append(int(at))
    return np.stack((one[chosen], other[chosen]), axis=1)


def _sides(directions: Floats) -> Floats:
    """Distances (n, n) between unit vectors."""
    apart = directions[:, None, :] - directions[None, :, :]
    return np.asarray(np.sqrt(np.sum(apart * apart, axis=2)), np.float32)


def _rotation(
    before: TimedStars, now: TimedStars, pairs: Indices, apart_s: float, meter: Meter
) -> Floats:
    """Rotation (3, 3) of the directions ``before`` in ``apart_s``, by least squares."""
    turn = np.eye(3, dtype=np.float32)
    for _ in range(_ROUNDS):
        measured = _in_time(before, now, pairs, _vector(turn), apart_s, meter)
        places = turned(before.directions[pairs[:, 0]], turn)
        more, _ = correction(measured, places, meter, with_scale=False)
        turn = (more @ turn).astype(np.float32)
        meter.charge(f32_mul=9 * len(pairs) + 27, f32_add=6 * len(pairs) + 18)
    return turn


def _in_time(
    before: TimedStars,
    now: TimedStars,
    pairs: Indices,
    turned_by: Floats,
    apart_s: float,
    meter: Meter,
) -> Floats:
    """Directions ``now`` (k, 3) of the pairs, ``apart_s`` after those before; ``turned_by``: (3,)
    rotation of the sky in that time, rad."""
    here = now.directions[pairs[:, 1]]
    share = (now.late_s[pairs[:, 1]] - before.late_s[pairs[:, 0]]) / np.float32(apart_s)
    meter.charge(f32_mul=10 * len(pairs), f32_add=7 * len(pairs), f32_div=len(pairs) + 1)
    return np.asarray(here - cross(turned_by, here) * share[:, None], np.float32)


def _vector(turn: Floats) -> Floats:
    """Rotation vector (3,) of a small rotation (3, 3), to first order; not charged."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = turn
    return np.array([zy - yz, xz - zx, yx - xy], np.float32) / np.float32(2)


def _odds(
    found: int,
    before: int,
    now: int,
    reach_rad: float,
    margin_rad: float,
    solid_angle_sr: float,
    meter: Meter,
) -> float:
    """False alarms where ``found`` of the stars ``before`` are among those ``now``: wrong rotations
    are pairs of wrong partners whose sides agree, as in tracking."""
    astray = before * by_chance(now, reach_rad, solid_angle_sr)
    tries = float(astray * astray / 2) * min(margin_rad / reach_rad, 1.0)
    chance = by_chance(now - FEWEST_STARS, margin_rad, solid_angle_sr)
    meter.charge(f32_mul=8, f32_div=3)
    further = before - FEWEST_STARS, found - FEWEST_STARS
    return false_alarm(tries, *further, chance, meter)
