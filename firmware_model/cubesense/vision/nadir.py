"""From the edges of the Earth to the direction of its centre.

CubeSense thesis, sections 4.4.1.3, 5.5, 6.5.3 and appendix C.5: undistort each edge, fit a circle,
hand out its centre as int of 1/100 px. Angles are the centre's coordinates at 2.9 px a degree.

The result codes are public, what leads to them is not; assumed:

- too many edges: more than the part keeps.

As printed there are no checks: every edge counts, the radius is not calculated, and only a division
by 0 or a centre that the interface does not have is a bad fit. With them:

- too few edges: fewer than `NadirConfig.min_edges`, here 6, twice the unknowns.
- bad fit: no circle, an angular radius that no altitude of interest has, a centre more than 100 deg
  away along an axis, which the interface does not have, or edges off the circle.
  Up to a quarter of the edges may be dropped first, the worst one at a time: hot pixels, the Moon.

An extension is the fit in the stereographic projection (see `Projection`). A circle there has the
centre (x, y) and gives the origin the power p; the cone that it is the image of has its axis along
(2 f x, 2 f y, f^2 - p).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision import arithmetic
from cubestack.firmware_model.cubesense.vision.circle import Circle, LeastSquaresCircle
from cubestack.firmware_model.cubesense.vision.distortion import FOCAL_PX, Projection, RadiusTable
from cubestack.firmware_model.cubesense.vision.edges import EdgeList
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.mcu.costs import Meter

DROPPED_SHARE = 4
"""One edge in so many may be dropped."""

MAX_RMS_PX = {Projection.EQUIDISTANT: 8.0, Projection.STEREOGRAPHIC: 0.5}
"""Largest root mean square distance of the edges from the circle, in px of the projection.

In the published projection the limb itself leaves the circle by this much towards the rim. In the
stereographic one, edges of a sunlit limb stay below 0.35 px, and a looser limit lets fits to the
terminator pass.
"""

LARGEST_PX = np.float32(codes.LARGEST_ANGLE_DEG * codes.PIXELS_PER_DEGREE)

Values = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class NadirConfig:
    """How the edges become a direction.

    Attributes:
        table: undistorts the edges.
        projection: that the table leads to.
        min_edges: fewer are too few.
        radius_deg: angular radii that the Earth may have: 96 to 6378 km of altitude.
        checked: whether these and the distances from the circle are looked at.
    """

    table: RadiusTable
    projection: Projection = Projection.STEREOGRAPHIC
    min_edges: int = 6
    radius_deg: tuple[float, float] = (30.0, 80.0)
    checked: bool = True


@dataclass(frozen=True)
class Direction:
    """What became of a detection.

    Attributes:
        detect: its result code.
        x, y: centre from the boresight, 1/100 px, undistorted; 0 without success.
        alpha, beta: the same, 1/100 deg.
    """

    detect: codes.DetectResult
    x: int = 0
    y: int = 0
    alpha: int = 0
    beta: int = 0


@dataclass(frozen=True)
class NadirResult(Direction):
    """A direction, and what it rests on.

    Attributes:
        edges: that the fit used; without a fit, that were found.
        dropped: edges left out of it.
        radius_deg: angular radius of the circle; 0 when there is none, or it was not calculated.
    """

    edges: int = 0
    dropped: int = 0
    radius_deg: float = 0.0


def angle_of(hundredths: NDArray[np.int16], meter: Meter) -> NDArray[np.int16]:
    """1/100 px, undistorted, to 1/100 deg, rounded towards zero."""
    count = hundredths.size
    meter.charge(f32_convert=2 * count, f32_div=count)
    return arithmetic.to_int16(hundredths.astype(np.float32) / np.float32(codes.PIXELS_PER_DEGREE))


def find_nadir(edges: EdgeList, config: NadirConfig, meter: Meter) -> NadirResult:
    """Undistort the edges, fit the circle, judge it. Phases: `undistort` and `fit`."""
    meter.charge(i8=3)
    if edges.full:
        return NadirResult(codes.DetectResult.TOO_MANY_EDGES, edges=len(edges))
    if config.checked and len(edges) < config.min_edges:
        return NadirResult(codes.DetectResult.TOO_FEW_EDGES, edges=len(edges))
    with meter.phase("undistort"):
        corrected = config.table.correct(edges.offsets(), meter)
        points = corrected.astype(np.float32) / arithmetic.HUNDREDTHS
        meter.charge(f32_convert=2 * len(points), f32_div=2 * len(points))
    with meter.phase("fit"):
        if config.checked:
            circle, used = _fit(points, config, meter)
        else:
            circle, used = _as_printed(points, config, meter), len(points)
        dropped = len(edges) - used
        if circle is None:
            return NadirResult(codes.DetectResult.BAD_FIT, edges=used, dropped=dropped)
        centre, radius_deg = _on_the_sky(circle, config.projection, meter)
        low, high = config.radius_deg if config.checked else (0.0, 180.0)
        if config.checked:
            meter.charge(f32_compare=4)
        in_range = bool(np.all(np.abs(centre) <= LARGEST_PX))
        if not (in_range and low <= radius_deg <= high):
            bad = codes.DetectResult.BAD_FIT
            return NadirResult(bad, edges=used, dropped=dropped, radius_deg=radius_deg)
        meter.charge(f32_mul=2, f32_convert=2)
        position = arithmetic.to_int16(centre * arithmetic.HUNDREDTHS)
        x, y, alpha, beta = (int(value) for value in (*position, *angle_of(position, meter)))
    return NadirResult(codes.DetectResult.SUCCESS, x, y, alpha, beta, used, dropped, radius_deg)


def _fit(points: Values, config: NadirConfig, meter: Meter) -> tuple[Circle | None, int]:
    """Circle through all but a few of the points, and how many it used; None for a bad one."""
    limit = np.float32(MAX_RMS_PX[config.projection] ** 2)
    equations = LeastSquaresCircle(points, meter)
    fewest = max(config.min_edges, len(points) - len(points) // DROPPED_SHARE)
    while True:
        circle = equations.solve()
        if circle is None:
            return None, len(points)
        square = circle.residuals(points, meter) ** 2
        count = len(points)
        meter.charge(f32_mul=count + 1, f32_add=count, f32_compare=count + 1, f32_div=1)
        if arithmetic.sequential_sum(square) / np.float32(count) <= limit:
            return circle, count
        if count == fewest:
            return None, count
        worst = int(np.argmax(square))
        equations.remove(points[worst])
        points = np.delete(points, worst, axis=0)


def _as_printed(points: Values, config: NadirConfig, meter: Meter) -> Circle | None:
    """Circle through all points, without a radius where only its centre is wanted."""
    equations = LeastSquaresCircle(points, meter)
    if config.projection is not Projection.EQUIDISTANT:
        return equations.solve()
    centre = equations.centre()
    return None if centre is None else Circle(centre[0], centre[1], np.float32(0))


def _on_the_sky(circle: Circle, projection: Projection, meter: Meter) -> tuple[Values, float]:
    """Centre (2,) in equidistant px from the boresight, and the angular radius in degrees."""
    centre = np.array([circle.x, circle.y], np.float32)
    if circle.radius == 0:
        return centre, 0.0
    if projection is Projection.EQUIDISTANT:
        meter.charge(f32_div=1)
        return centre, float(circle.radius / np.float32(codes.PIXELS_PER_DEGREE))
    f = FOCAL_PX
    power = circle.power
    distance = np.sqrt(circle.x * circle.x + circle.y * circle.y)
    theta = np.arctan2(2 * f * distance, f * f - power)
    rho = np.arctan2(2 * f * circle.radius, f * f + power)
    over = distance if distance > 0 else np.float32(1)
    meter.charge(f32_mul=12, f32_add=5, f32_sqrt=1, f32_atan2=2, f32_compare=1, f32_div=1)
    return centre * (f * theta / over), float(np.degrees(rho))
