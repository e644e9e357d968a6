"""Direction of the Earth's centre from its edges.

CubeSense thesis, sections 4.4.1.3, 5.5, 6.5.3 and appendix C.5: undistort each edge, fit a circle,
return its centre as int of 1/100 px. Angles are the centre's coordinates at 2.9 px per degree.

The result codes are public, their conditions are not; assumed:

- too many edges: more than the part stores.

As printed there are no checks: every edge counts, the radius is not calculated, and only a division
by 0 or a centre outside of the interface's range is a bad fit. With checks:

- too few edges: fewer than `NadirConfig.min_edges`, in all or on the circle.
- bad fit: no circle, an angular radius impossible at an altitude of interest, a centre more than
  100 deg away along an axis, outside of the interface's range, or half as many edges again off the
  circle as on it beyond the three that define it (`limb`).

An extension is the fit in the stereographic projection (see `Projection`). If a circle there has
the centre (x, y) and the origin has the power p, it is the image of a cone with its axis along (2 f
x, 2 f y, f^2 - p).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision import arithmetic
from cubestack.firmware_model.cubesense.vision.circle import FEWEST, Circle, LeastSquaresCircle
from cubestack.firmware_model.cubesense.vision.distortion import FOCAL_PX, Projection, RadiusTable
from cubestack.firmware_model.cubesense.vision.edges import EdgeList
from cubestack.firmware_model.cubesense.vision.limb import Limb, Tolerances, far_off, find_limb
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.mcu.costs import Meter

LIT = {
    Projection.STEREOGRAPHIC: Tolerances(on_px=1.0, good_rms_px=0.35, usual_px=0.1),
    Projection.EQUIDISTANT: Tolerances(on_px=12.0, good_rms_px=8.0, usual_px=3.0),
}
"""Of well-lit edges. In the published projection the limb itself deviates from the circle by this
much towards the rim."""

DUSK = 3  #: factor of the tolerance for limb edges along the dusk

#: Tolerances of edges along the dusk.
DIM = {kind: replace(allowed, usual_px=2 * allowed.usual_px) for kind, allowed in LIT.items()}

FLOOR_DEG = 0.01  #: part of the standard deviation that more edges do not reduce

MOST_SIGMA = 0xFFFF

LARGEST_PX = np.float32(codes.LARGEST_ANGLE_DEG * codes.PIXELS_PER_DEGREE)

Values = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class NadirConfig:
    """Settings of the fit."""

    table: RadiusTable  #: undistorts the edges
    projection: Projection = Projection.STEREOGRAPHIC  #: of the table
    #: smallest number: three define a circle, a fourth tests whether it is the limb's
    min_edges: int = 4
    #: range of the Earth's angular radius: 96 to 6378 km of altitude
    radius_deg: tuple[float, float] = (30.0, 80.0)
    checked: bool = True  #: whether radius and distances from the circle are checked

    def reason_if_checked(self, reason: codes.Reason) -> codes.Reason:
        """``reason`` if results are checked; the published program reports none."""
        return reason if self.checked else codes.Reason.NONE

    @property
    def bounds(self) -> tuple[float, float, float]:
        low, high = np.tan(np.radians(self.radius_deg))
        return float(low), float(high), float(FOCAL_PX)


@dataclass(frozen=True)
class Direction:
    """Outcome of a detection."""

    detect: codes.DetectResult  #: its result code
    #: x, y: centre from the boresight, 1/100 px, undistorted; 0 without success
    x: int = 0
    y: int = 0
    #: alpha, beta: the same, 1/100 deg
    alpha: int = 0
    beta: int = 0
    #: sigma_alpha, sigma_beta: standard deviations of these, 1/100 deg; 0: unknown
    sigma_alpha: int = 0
    sigma_beta: int = 0
    reason: codes.Reason = codes.Reason.NONE  #: of the outcome, if it is checked


@dataclass(frozen=True)
class NadirResult(Direction):
    """A direction, and the data of its fit."""

    edges: int = 0  #: number used in the fit; without a fit, number found
    dropped: int = 0  #: edges left out of it
    #: angular radius of the circle; 0 if there is none, or it was not calculated
    radius_deg: float = 0.0
    rms_px: float = 0.0  #: of the distances of these edges from the circle, in px of the projection


def angle_of(hundredths: NDArray[np.int16], meter: Meter) -> NDArray[np.int16]:
    """1/100 px, undistorted, to 1/100 deg, rounded towards zero."""
    count = hundredths.size
    meter.charge(f32_convert=2 * count, f32_div=count)
    return arithmetic.to_int16(hundredths.astype(np.float32) / np.float32(codes.PIXELS_PER_DEGREE))


def find_nadir(edges: EdgeList, config: NadirConfig, meter: Meter) -> NadirResult:
    """Undistort the edges, fit the circle, check it. Phases: `undistort` and `fit`."""
    meter.charge(i8=3)
    bad, why = codes.DetectResult.BAD_FIT, codes.Reason
    if edges.full:
        many = codes.DetectResult.TOO_MANY_EDGES
        return NadirResult(many, edges=len(edges), reason=config.reason_if_checked(why.MANY_EDGES))
    if config.checked and len(edges) < config.min_edges:
        few = codes.DetectResult.TOO_FEW_EDGES
        return NadirResult(few, edges=len(edges), reason=why.FEW_EDGES)
    with meter.phase("undistort"):
        corrected = config.table.correct(edges.offsets(), meter)
        points = corrected.astype(np.float32) / arithmetic.HUNDREDTHS
        meter.charge(f32_convert=2 * len(points), f32_div=2 * len(points))
    with meter.phase("fit"):
        limb = None
        if config.checked:
            limb = _limb(points, edges, config, meter)
            circle, used = (None, 0) if limb is None else (limb.circle, limb.on_circle)
        else:
            circle, used = _circle_as_printed(points, config, meter), len(points)
        fit = NadirResult(bad, edges=used, dropped=len(edges) - used)
        if circle is None:
            return replace(fit, reason=config.reason_if_checked(why.NO_CIRCLE))
        centre, radius_deg = _on_the_sky(circle, config.projection, meter)
        fit = replace(fit, radius_deg=radius_deg)
        low, high = config.radius_deg if config.checked else (0.0, 180.0)
        if config.checked:
            meter.charge(f32_compare=4, i8=4)
        if not (np.all(np.abs(centre) <= LARGEST_PX) and low <= radius_deg <= high):
            return replace(fit, reason=config.reason_if_checked(why.WRONG_RADIUS))
        if limb is not None:
            if used < config.min_edges:
                return replace(fit, reason=why.FEW_EDGES)
            off_px = DUSK * LIT[config.projection].on_px
            against = far_off(circle, points, edges.sides, off_px, meter)
            # Up to three edges off the circle count fully; of more, a third may be wrong.
            if 3 * (used - FEWEST) <= 2 * against + min(against, 3):
                return replace(fit, reason=why.OTHER_LIGHT)
            sigma = _sigma(limb, centre, config.projection, meter)
            fit = replace(
                fit,
                sigma_alpha=sigma[0],
                sigma_beta=sigma[1],
                rms_px=limb.rms_px,
                reason=why.MEASURED,
            )
        meter.charge(f32_mul=2, f32_convert=2)
        position = arithmetic.to_int16(centre * arithmetic.HUNDREDTHS)
        x, y, alpha, beta = (int(value) for value in (*position, *angle_of(position, meter)))
    success = codes.DetectResult.SUCCESS
    return replace(fit, detect=success, x=x, y=y, alpha=alpha, beta=beta)


def _limb(points: Values, edges: EdgeList, config: NadirConfig, meter: Meter) -> Limb | None:
    """The limb of the well-lit edges if they suffice, else of all edges."""
    lit = edges.lit
    meter.charge(i8=3 * len(lit))
    if np.count_nonzero(lit) >= config.min_edges:
        limb = find_limb(
            points[lit], edges.sides[lit], LIT[config.projection], config.bounds, meter
        )
        if limb is not None and limb.on_circle >= config.min_edges:
            return limb
    return find_limb(points, edges.sides, DIM[config.projection], config.bounds, meter)


def _sigma(limb: Limb, centre: Values, projection: Projection, meter: Meter) -> tuple[int, int]:
    """Standard deviations of alpha and beta, 1/100 deg, rounded.

    Sensitivities by finite differences of 1 px in centre and radius.
    """
    circle, one = limb.circle, np.float32(1)
    moved = (
        Circle(circle.x + one, circle.y, circle.radius),
        Circle(circle.x, circle.y + one, circle.radius),
        Circle(circle.x, circle.y, circle.radius + one),
    )
    slopes = np.stack(
        [_on_the_sky(other, projection, meter)[0] - centre for other in moved], axis=1
    ) / np.float32(codes.PIXELS_PER_DEGREE)
    variance = np.einsum("ai,ij,aj->a", slopes, limb.covariance, slopes)
    meter.charge(f32_mul=2 * 12, f32_add=2 * 9 + 6, f32_div=6, f32_sqrt=2, f32_convert=2)
    sigma = np.sqrt(np.maximum(variance, 0) + FLOOR_DEG**2) * 100
    alpha, beta = (int(min(np.floor(value + 0.5), MOST_SIGMA)) for value in sigma)
    return alpha, beta


def _circle_as_printed(points: Values, config: NadirConfig, meter: Meter) -> Circle | None:
    """Circle through all points, without a radius if only its centre is needed."""
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
