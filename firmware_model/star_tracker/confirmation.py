"""Acceptance of an attitude by the stars that it predicts.

Let N catalogue stars be predicted besides those that define the attitude, and f of them be found.
If the attitude is wrong, a measured star is within the radius of a predicted one with probability
c: the area of all radii over that of the image. If it is right, a star is seen with an unknown
probability s: stray light, a high threshold or a short exposure hide stars. All s from 0 to 1 are
equally likely, so the likelihood ratio is

    L = integral of s^f (1 - s)^(N - f) ds / (c^f (1 - c)^(N - f))
      = 1 / ((N + 1) * C(N, f) * c^f * (1 - c)^(N - f))

A wrong attitude reaches L with a probability of at most 1 / L (Markov's inequality, as the mean
ratio of wrong ones is 1). Multiplied by the expected number of wrong attitudes among those tried, 1
/ L is the expected number of false alarms per image. Lang et al. 2010, "Astrometry.net", section
2.3, decides by such a ratio, with a fixed share of seen stars.
"""

from math import comb, hypot, pi
from operator import mul

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import FLOAT, INT, POINTER, Loop, address

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

_MATCHED = Loop(
    "stars_matched", POINTER, INT, POINTER, INT, FLOAT, POINTER, POINTER, POINTER, POINTER
)

#: Added to the normal equations: a turn that nothing determines is none.
_ALMOST_NOTHING = np.eye(4, dtype=np.float32) * np.float32(1e-6)
_SIDES = ((0, 1), (0, 2), (1, 2))


def matched(
    measured: Floats, predicted: Floats, radius_rad: float, meter: Meter
) -> tuple[Indices, Indices, Floats]:
    """Rows of ``measured`` and ``predicted`` unit vectors (n, 3) and (m, 3) that are nearest to
    each other, and their distances in rad (k,), at most a small ``radius_rad``.

    Squares of chords are compared, which single precision resolves better than cosines; most pairs
    are excluded by the first component, as an integer.
    """
    count, compared = len(measured) + len(predicted), len(measured) * len(predicted)
    if compared == 0:
        nothing = np.zeros(0, np.intp)
        return nothing, nothing, np.zeros(0, np.float32)
    reach = float(radius_rad) ** 2
    nearest, rows, distances, near = (_nearest_compiled if _MATCHED else _nearest)(
        measured, predicted, reach
    )
    meter.charge(
        f32_mul=count + 3 * near,
        f32_convert=count,
        f32_add=5 * near,
        f32_compare=2 * near,
        ram_read=compared + 4 * near,
        i32_add=2 * compared,
        loop=compared,
    )
    return nearest, rows, distances


def _nearest(
    measured: Floats, predicted: Floats, reach: float
) -> tuple[Indices, Indices, Floats, int]:
    """``matched`` within the square ``reach``, and pairs whose first components are as close."""
    apart = predicted.T[:, :, None] - measured.T[:, None, :]
    apart *= apart
    first, second, third = apart
    near = int(np.count_nonzero(first <= reach))
    chord2 = first + second + third
    inside = (chord2.ravel() <= reach).nonzero()[0]
    rows, nearest = np.divmod(inside, len(measured))
    smallest = chord2.take(inside)
    if len(set(rows.tolist())) < len(rows) or len(set(nearest.tolist())) < len(rows):
        kept = (chord2.argmin(axis=1)[rows] == nearest) & (chord2.argmin(axis=0)[nearest] == rows)
        rows, nearest, smallest = rows[kept], nearest[kept], smallest[kept]
    return nearest, rows, np.sqrt(smallest), near


def _nearest_compiled(
    measured: Floats, predicted: Floats, reach: float
) -> tuple[Indices, Indices, Floats, int]:
    here, there = np.ascontiguousarray(measured), np.ascontiguousarray(predicted)
    most = min(len(here), len(there))
    found, distances = np.empty((3, most), np.intp), np.empty(most, np.float32)
    at = address(found)
    places = at, at + 8 * most, address(distances), at + 16 * most
    count = _MATCHED(address(here), len(here), address(there), len(there), reach, *places)
    return found[0, :count], found[1, :count], distances[:count], int(found[2, 0])


def false_alarm(hypotheses: float, expected: int, found: int, chance: float, meter: Meter) -> float:
    """Expected number of wrong attitudes that are confirmed as well as this one.

    Args:
        hypotheses: expected wrong attitudes among those tried so far.
        expected: catalogue stars predicted in the image, besides those that define the attitude.
        found: how many of them were found.
        chance: that a measured star is near a predicted one by chance; see ``by_chance``.
        meter: charged with the product, factor by factor.
    """
    squares = 2 * max(expected - found, 1).bit_length()  # (1 - c)^(N - f)
    meter.charge(
        f32_mul=3 * found + 2 + squares, f32_div=found, f32_convert=2 * found, f32_add=2, loop=found
    )
    found = min(found, expected)
    ways = (expected + 1) * comb(expected, found)
    return float(hypotheses * ways * chance**found * (1 - chance) ** (expected - found))


def by_chance(spare: int, radius_rad: float, solid_angle_sr: float) -> float:
    """Probability that one of ``spare`` measured stars, at random in a picture of a solid angle, is
    within a radius of a place."""
    return min(spare * pi * radius_rad**2 / solid_angle_sr, 0.5)


def correction(
    measured: Floats, predicted: Floats, meter: Meter, *, with_scale: bool
) -> tuple[Floats, float]:
    """Small rotation (3, 3) of the predicted unit vectors (n, 3), and factor of the tangents of the
    measured ones (n, 3), that fit both by least squares; without scale the factor is 1. It is
    linear: differences of 0.01 rad leave 0.0001."""
    x, y, z = predicted.T
    size, count = 4 if with_scale else 3, len(predicted)
    # What turns about x, y, z and scale change, and what is to be explained.
    design = np.zeros((size + 1, 3, count), np.float32)
    design[0, 1], design[0, 2] = -z, y
    design[1, 0], design[1, 2] = z, -x
    design[2, 0], design[2, 1] = -y, x
    if with_scale:
        rays = measured.T
        design[3] = rays * (rays[0] * rays[0] + rays[1] * rays[1])
        design[3, :2] -= rays[:2]
    design[size] = (measured - predicted).T
    rows = design.reshape(size + 1, -1)
    product = rows @ rows.T
    meter.charge(
        f32_mul=(3 * size * (size + 3) // 2 + 5) * count + size**3 // 3 + 20,
        f32_add=(3 * size * (size + 3) // 2 + 6) * count + size**3 // 3 + 20,
        f32_div=size + 2,
        ram_read=6 * count,
        loop=count + 2 * size * size,
    )
    normal = product[:size, :size] + _ALMOST_NOTHING[:size, :size]
    solution = np.linalg.solve(normal, product[:size, size]).tolist()
    a, b, c = (part / 2 for part in solution[:3])
    share = 2 / (1 + a * a + b * b + c * c)
    rotation = np.array(
        [
            [1 - share * (b * b + c * c), share * (a * b - c), share * (a * c + b)],
            [share * (a * b + c), 1 - share * (a * a + c * c), share * (b * c - a)],
            [share * (a * c - b), share * (b * c + a), 1 - share * (a * a + b * b)],
        ],
        np.float32,
    )
    return rotation, 1.0 + solution[3] if with_scale else 1.0


def from_three(measured: Floats, reference: Floats, meter: Meter) -> Floats:
    """Direction cosine matrix (3, 3), reference to measured axes, of three unit vectors (3, 3): of
    the widest pair, half of its misfit at each star."""
    meter.charge(f32_mul=9 + 2 * 24 + 27, f32_add=6 + 2 * 18 + 18, f32_sqrt=4, f32_div=4)
    vectors, known = measured.tolist(), reference.tolist()
    cosines = {(i, j): sum(map(mul, vectors[i], vectors[j])) for i, j in _SIDES}
    i, j = min(cosines, key=lambda side: cosines[side])
    there, here = _axes(vectors[i], vectors[j]), _axes(known[i], known[j])
    return (there.T @ here).astype(np.float32)


def volumes(triples: Floats) -> NDArray[np.float64]:
    """Six times the volumes (n,) spanned by three vectors each (n, 3, 3), signed by their
    orientation; not charged."""
    (a, b, c), (d, e, f), (g, h, i) = triples.astype(np.float64).transpose(1, 2, 0)
    return np.asarray(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g))


def _axes(one: list[float], other: list[float]) -> NDArray[np.float64]:
    """Rows: the middle between two unit vectors, their difference, and what is square to both."""
    middle = [u + v for u, v in zip(one, other, strict=True)]
    apart = [v - u for u, v in zip(one, other, strict=True)]
    long, short = hypot(*middle), hypot(*apart)
    (a, b, c), (d, e, f) = [u / long for u in middle], [u / short for u in apart]
    return np.array([[a, b, c], [d, e, f], [b * f - c * e, c * d - a * f, a * e - b * d]])
