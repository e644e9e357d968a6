"""Whether an attitude can be believed: the stars that it predicts, beside the measured ones.

An attitude puts catalogue stars into the picture. Those that stand where a star was measured speak
for it, those that are missing against it. Say N stars are predicted besides those that the attitude
was made from, and f of them are found. If it is wrong, a predicted star has a measured one in its
reach by chance: with a probability c, the area of all reaches over that of the picture. If it is
right, it is seen with a probability s that nobody knows: clouds of light, a high threshold or a
short exposure hide stars. So every s from 0 to 1 counts alike, and the ratio of the likelihoods is

    L = integral of s^f (1 - s)^(N - f) ds / (c^f (1 - c)^(N - f))
      = 1 / ((N + 1) * C(N, f) * c^f * (1 - c)^(N - f))

A wrong attitude reaches a ratio of L with a probability of at most 1 / L, whatever L is (Markov's
inequality, as a ratio's mean over wrong ones is 1). With the number of wrong attitudes that could
have been met on the way, 1 / L gives the false alarms to be expected in a picture: the measure of
belief. A likelihood ratio decides so in Lang et al. 2010, "Astrometry.net", section 2.3, with a
share of seen stars that is set.
"""

from math import comb, hypot, pi
from operator import mul

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

#: Added to the normal equations: a turn that nothing determines is none.
_ALMOST_NOTHING = np.eye(4, dtype=np.float32) * np.float32(1e-6)
_SIDES = ((0, 1), (0, 2), (1, 2))


def matched(
    measured: Floats, predicted: Floats, radius_rad: float, meter: Meter
) -> tuple[Indices, Indices, Floats]:
    """Measured (n, 3) and predicted (m, 3) unit vectors that are nearest to each other.

    Returns rows of ``measured``, rows of ``predicted`` (k,) and their distances in rad; at most
    ``radius_rad``, which must be small. Compared are squares of chords, which single precision
    resolves better than cosines; most candidates fall out by the first component, as an integer.
    """
    count, compared = len(measured) + len(predicted), len(measured) * len(predicted)
    if compared == 0:
        nothing = np.zeros(0, np.intp)
        return nothing, nothing, np.zeros(0, np.float32)
    apart = predicted.T[:, :, None] - measured.T[:, None, :]
    apart *= apart
    first, second, third = apart
    reach = float(radius_rad) ** 2
    near = int(np.count_nonzero(first <= reach))
    meter.charge(
        f32_mul=count + 3 * near,
        f32_convert=count,
        f32_add=5 * near,
        f32_compare=2 * near,
        ram_read=compared + 4 * near,
        i32_add=2 * compared,
        loop=compared,
    )
    chord2 = first + second + third
    inside = (chord2.ravel() <= reach).nonzero()[0]
    rows, nearest = np.divmod(inside, len(measured))
    smallest = chord2.take(inside)
    if len(set(rows.tolist())) < len(rows) or len(set(nearest.tolist())) < len(rows):
        kept = (chord2.argmin(axis=1)[rows] == nearest) & (chord2.argmin(axis=0)[nearest] == rows)
        rows, nearest, smallest = rows[kept], nearest[kept], smallest[kept]
    return nearest, rows, np.sqrt(smallest)


def false_alarm(hypotheses: float, expected: int, found: int, chance: float, meter: Meter) -> float:
    """Wrong attitudes to be expected that are confirmed as well as this one.

    Args:
        hypotheses: wrong attitudes to be expected among those tried so far; at least as many as
            were tried where nothing better is known.
        expected: catalogue stars predicted in the picture, besides those that made the attitude.
        found: how many of them were found.
        chance: that a measured star lies in reach of a predicted one by chance; see ``by_chance``.
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
    """Probability that one of ``spare`` measured stars, strewn over a picture of a solid angle,
    lies within a radius of a place."""
    return min(spare * pi * radius_rad**2 / solid_angle_sr, 0.5)


def correction(
    measured: Floats, predicted: Floats, meter: Meter, *, with_scale: bool
) -> tuple[Floats, float]:
    """Small rotation (3, 3) of the predicted unit vectors (n, 3) and factor for the tangents of the
    measured ones (n, 3) that bring both together by least squares; without scale the factor is 1.

    Differences are taken as small: some 0.01 rad are left as 0.0001.
    """
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
    """Direction cosine matrix (3, 3), reference to measured axes, of three unit vectors (3, 3).

    The pair that is widest apart gives it, half of its misfit to each star; the third star decides
    nothing.
    """
    meter.charge(f32_mul=9 + 2 * 24 + 27, f32_add=6 + 2 * 18 + 18, f32_sqrt=4, f32_div=4)
    vectors, known = measured.tolist(), reference.tolist()
    cosines = {(i, j): sum(map(mul, vectors[i], vectors[j])) for i, j in _SIDES}
    i, j = min(cosines, key=lambda side: cosines[side])
    there, here = _axes(vectors[i], vectors[j]), _axes(known[i], known[j])
    return (there.T @ here).astype(np.float32)


def volume(vectors: Floats) -> float:
    """Six times the volume that three vectors (3, 3) span; its sign says which way they turn.
    The caller charges the meter."""
    (a, b, c), (d, e, f), (g, h, i) = vectors.tolist()
    return float(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g))


def _axes(one: list[float], other: list[float]) -> NDArray[np.float64]:
    """Rows: the middle between two unit vectors, their difference, and what is square to both."""
    middle = [u + v for u, v in zip(one, other, strict=True)]
    apart = [v - u for u, v in zip(one, other, strict=True)]
    long, short = hypot(*middle), hypot(*apart)
    (a, b, c), (d, e, f) = [u / long for u in middle], [u / short for u in apart]
    return np.array([[a, b, c], [d, e, f], [b * f - c * e, c * d - a * f, a * e - b * d]])
