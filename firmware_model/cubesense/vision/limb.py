"""The Earth's limb among edges that may not all be its own: a circle, and its uncertainty.

An extension; CubeSense thesis, section 4.4.1.3, fits a circle through all edges. Here:

1. A circle through all edges, if all lie on it (least squares, as published).
2. Otherwise circles through three edges each (RANSAC: Fischler and Bolles 1981, Comm. of the ACM
24, 381), drawn by a fixed rule. Only those that are possible at an altitude of interest are tested;
the one with most edges on it wins. An edge counts if its bright side is towards the centre, which
distinguishes the limb from the far side of the Moon, of glints and of the shadow.
3. From there, least squares of the distances (Gauss and Newton), because the sum of squares of step
1 pulls circles through short arcs inwards; edges that are not on the circle are left out.

The uncertainty is that of the fit: the inverse of its normal equations, which reflects the length
of the arc, times the edges' variance. That variance is a posterior mean of the usual one, with the
weight of `PRIOR` edges, and that of these edges; variance beyond the usual one counts `EXCESS`
times. Edges left out increase it in proportion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.circle import FEWEST, Circle, LeastSquaresCircle
from cubestack.firmware_model.mcu.costs import Meter

END_PX = np.float32(0.02)  #: least squares end when the circle moves by less

#: Most comparisons of edges with circles, and number of triples: as many as a second allows.
COMPARISONS, TRIPLES = 400, 48

#: With few edges a false one goes unnoticed: variance * (1 + FEW * number / (number - 3)^2).
FEW = 2

STEPS = 3  #: most steps of Gauss and Newton
EXCESS = 4.0  #: weight of variance beyond the usual one: clouds move neighbouring edges alike
PRIOR = 6  #: weight of the usual standard deviation, in edges

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of a limb's edges, in px of the projection."""

    on_px: float  #: an edge this near to the circle is on it
    good_rms_px: float  #: largest rms at which all edges together are a limb
    usual_px: float  #: standard deviation of an edge's distance in usual images


@dataclass(frozen=True, eq=False)
class Limb:
    """A circle through the limb."""

    circle: Circle  #: in px of the points
    on: NDArray[np.bool_]  #: mask of the points on it (n,)
    rms_px: float  #: of their distances
    covariance: Values  #: (3, 3) of centre and radius, px^2

    @property
    def on_circle(self) -> int:
        return int(np.count_nonzero(self.on))


def find_limb(
    points: Values,
    sides: NDArray[np.int8],
    allowed: Tolerances,
    tangents: tuple[float, float, float],
    meter: Meter,
) -> Limb | None:
    """The circle with most of the points on it.

    Args:
        points: (n, 2) px, in a projection that images circles as circles.
        sides: (n, 2) towards the bright side of each: one of x and y is 1 or -1, the other 0.
        allowed: tolerances of the edges.
        tangents: smallest and largest tangent of the Earth's angular radius, and the focal length:
            px.
        meter: charged.
    """
    if len(points) < FEWEST:
        return None
    circle = LeastSquaresCircle(points, meter).solve()
    if circle is None or not _all_on(circle, points, sides, allowed.good_rms_px, meter):
        circle = _most_on(points, sides, allowed.on_px, tangents, meter)
    return None if circle is None else _refine(circle, points, sides, allowed, meter)


def far_off(
    circle: Circle, points: Values, sides: NDArray[np.int8], most_px: float, meter: Meter
) -> int:
    """Number of points further off than ``most_px``, or with their bright side outside."""
    distance, right = _distances(circle, points, sides, meter)
    meter.charge(f32_compare=len(points))
    return int(np.count_nonzero(~right | (np.abs(distance) > np.float32(most_px))))


def _distances(
    circle: Circle, points: Values, sides: NDArray[np.int8], meter: Meter
) -> tuple[Values, NDArray[np.bool_]]:
    """Distances of points outside of the circle (n,), and whether their sides are right (n,)."""
    count = len(points)
    # Sides are signs of differences that were computed before.
    meter.charge(f32_add=4 * count, f32_mul=3 * count, i8=4 * count, loop=count)
    towards = np.array([circle.x, circle.y], np.float32) - points
    return circle.residuals(points, Meter(meter.table)), (towards * sides).sum(axis=1) > 0


def _all_on(
    circle: Circle, points: Values, sides: NDArray[np.int8], good_rms_px: float, meter: Meter
) -> bool:
    distance, right = _distances(circle, points, sides, meter)
    meter.charge(f32_mul=len(points), f32_add=len(points), f32_div=1, f32_compare=1)
    return bool(right.all() and np.mean(distance * distance) <= good_rms_px**2)


def _triples(count: int) -> list[tuple[int, int, int]]:
    """Triples of ``count`` numbers, from a linear congruential generator of 16 bits."""
    drawn: list[tuple[int, int, int]] = []
    state = 1
    while len(drawn) < TRIPLES:
        numbers = []
        for _ in range(3):
            state = (state * 25173 + 13849) & 0xFFFF
            numbers.append((state >> 8) * count >> 8)
        if len(set(numbers)) == 3:
            drawn.append((numbers[0], numbers[1], numbers[2]))
    return drawn


def _through(three: Values, meter: Meter) -> Circle | None:
    meter.charge(f32_add=12, f32_mul=14, f32_div=2, f32_sqrt=1, f32_compare=1, call=1)
    (ax, ay), (bx, by), (cx, cy) = three
    bx, by, cx, cy = bx - ax, by - ay, cx - ax, cy - ay
    double = 2 * (bx * cy - by * cx)
    if abs(double) < 1:
        return None
    b, c = bx * bx + by * by, cx * cx + cy * cy
    x, y = (cy * b - by * c) / double, (bx * c - cx * b) / double
    return Circle(ax + x, ay + y, np.sqrt(x * x + y * y))


def _most_on(
    points: Values,
    sides: NDArray[np.int8],
    on_px: float,
    tangents: tuple[float, float, float],
    meter: Meter,
) -> Circle | None:
    low, high, focal = (np.float32(value) for value in tangents)
    best, most, compared = None, 0, 0
    meter.charge(i16_add=9 * TRIPLES, loop=3 * TRIPLES)
    for triple in _triples(len(points)):
        circle = _through(points[list(triple)], meter)
        if circle is None:
            continue
        meter.charge(f32_mul=6, f32_add=3, f32_compare=3)
        over = 2 * focal * circle.radius
        under = focal * focal + circle.power
        if not low * under <= over <= high * under:
            continue
        distance, right = _distances(circle, points, sides, meter)
        meter.charge(f32_compare=len(points))
        if not right[list(triple)].all():
            continue
        compared += len(points)
        count = int(np.count_nonzero(right & (np.abs(distance) < np.float32(on_px))))
        if count > most:
            best, most = circle, count
        if compared >= COMPARISONS or 5 * most >= 4 * len(points):
            break
    return best


def _refine(
    circle: Circle, points: Values, sides: NDArray[np.int8], allowed: Tolerances, meter: Meter
) -> Limb | None:
    """Least squares of the distances of the points on the circle."""
    for _ in range(STEPS):
        distance, right = _distances(circle, points, sides, meter)
        on = right & (np.abs(distance) < np.float32(allowed.on_px))
        count = int(np.count_nonzero(on))
        if count < FEWEST:
            return None
        away = points[on] - np.array([circle.x, circle.y], np.float32)
        length = np.sqrt((away * away).sum(axis=1))
        rows = np.column_stack([away / length[:, None], np.ones(count, np.float32)])
        meter.charge(
            f32_mul=(2 + 9) * count + 30,
            f32_add=(1 + 9) * count + 20,
            f32_div=2 * count + 3,
            f32_sqrt=count,
            f32_compare=len(points) + 3,
            loop=count,
        )
        normal = (rows.T @ rows).astype(np.float64)
        if not np.linalg.det(normal) > 1e-6 * count**3:
            return None
        inverse = np.linalg.inv(normal)
        off = length - circle.radius
        step = (inverse @ (rows.T @ off)).astype(np.float32)
        circle = Circle(circle.x + step[0], circle.y + step[1], circle.radius + step[2])
        if np.abs(step).max() < END_PX:
            break
    left = off - rows @ step
    square = float(left @ left)
    variance = (PRIOR * allowed.usual_px**2 + square) / (PRIOR + count - 3)
    usual = allowed.usual_px**2
    variance = max(variance, usual + EXCESS * (variance - usual))
    variance *= (len(points) / count) ** 2 * (1 + FEW * count / max(count - 3, 1) ** 2)
    meter.charge(f32_mul=2 * count + 15, f32_add=3 * count + 3, f32_div=3)
    covariance = (variance * inverse).astype(np.float32)
    return Limb(circle, on, float(np.sqrt(square / count)), covariance)
