"""Difference between a camera's own lens and the polynomial that the firmware assumes.

CubeSense thesis, sections 5.2.1 (one polynomial, fitted to the nadir camera every 5 deg, serves
both cameras), 7.1 (figure 7.1: mean offsets of 0.12, 0.16, 0.13 and 0.15 deg in four directions)
and 7.2 (the Sun's offsets: below 0.3 deg to 40 deg, up to 1 deg to 60, up to 1.85 deg beyond, back
to none at 90; nearly all of one sign). Table 5.1 gives both boresights in whole pixels, and 226 px
as the radius of both rims, so errors end at the rim.

Which values are published, which are chosen, and which are random for each unit:

- The optical axis is anywhere in the pixel of table 5.1: random, uniform.
- The nadir lens differs at four field angles by `NADIR_SIGMA_DEG`: fitted, so that units have on
  average the error of figure 7.1 together with that of the printed firmware. Random, normal.
- The Sun lens has the published offsets at the ends of their ranges; that the greatest is at 75 deg
  is chosen. They are the largest of four directions, so a unit has `SUN_SHARE` of them: chosen,
  random, uniform.
- Decentring by `DECENTRING_SIGMA_DEG`: chosen, as four directions differ by 0.04 deg; random.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.residual import Displacement
from cubestack.emulator.light.lens_curve import LensCurve
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.values import REQUIRED, DeclaredValues, many, number, vector

FIELD_DEG = 95.0
"""Largest angle from the boresight that the lens images, half of 190 deg (appendix A.3)."""

NADIR_NODES_DEG = (20.0, 40.0, 60.0, 80.0)  # chosen
NADIR_SIGMA_DEG = 0.12  # fitted to figure 7.1
# Published; their angles within the ranges are chosen, as are the share and the decentring.
SUN_OFFSETS_DEG = ((40.0, 0.3), (60.0, 1.0), (75.0, 1.85), (90.0, 0.0))
SUN_SHARE = (0.6, 1.0)
DECENTRING_SIGMA_DEG = 0.04

MOST_PX = 20.0
STEEPEST = 0.5
"""Greatest accepted slope of the error over the field angle: the picture must not fold."""

_INVERSION_STEPS = 50
_INVERSION_DEG = 1e-9

Angles = NDArray[np.float64]


@dataclass(frozen=True)
class LensError(DeclaredValues):
    """The part of one lens that the polynomial does not describe; none by default.

    This lens images a direction where the polynomial images another one, whose angles alpha and
    beta are those of the first plus this error.

    The boresight is that of table 5.1. Field angles rise within 0 and 95 deg; a smooth curve goes
    through their errors, 0 on the axis and at the rim, without exceeding them. Decentring is in deg
    at the rim, but falls off towards it. ``residuals`` are further displacements of the picture.
    """

    error = SceneError

    centre_px: tuple[float, float] = vector(
        2, (0.0, 0.0), "optical axis minus boresight", -MOST_PX, MOST_PX
    )
    radial_deg: tuple[tuple[float, float], ...] = many(
        (), "pairs of field angle and outward error there", vector(2, REQUIRED, "")
    )
    decentring_deg: tuple[float, float] = vector(2, (0.0, 0.0), "Brown's p1 and p2")
    scale: float = number(1.0, "of the picture about the optical axis", 0.85, 1.15)
    residuals: tuple[Displacement, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        nodes = [0.0, *(angle for angle, _ in self.radial_deg), FIELD_DEG]
        if not np.all(np.diff(nodes) > 0):
            raise SceneError(
                f"radial_deg must have rising field angles within 0 and {FIELD_DEG:g} deg, "
                f"not {[list(pair) for pair in self.radial_deg]}"
            )
        turn = np.radians(np.arange(0, 360, 15))[:, None]
        along = np.linspace(0.0, FIELD_DEG, 96)
        angles = np.stack([along * np.cos(turn), along * np.sin(turn)], axis=-1)
        slope = np.diff(self.displace(angles) - angles, axis=1) / along[1]
        if not np.hypot(slope[..., 0], slope[..., 1]).max() <= STEEPEST:
            raise SceneError(
                f"radial_deg and decentring_deg must change by at most {STEEPEST:g} deg a degree"
            )

    def displace(self, angles: ArrayLike) -> Angles:
        """Angles (..., 2) that the polynomial images where this lens images ``angles``."""
        return np.stack(self._displaced(*np.moveaxis(np.asarray(angles, np.float64), -1, 0)), -1)

    def _displaced(self, alpha: Angles, beta: Angles) -> tuple[Angles, Angles]:
        """As `displace`, with arrays of their own, which is faster."""
        if not self.radial_deg and not any(self.decentring_deg):
            return alpha, beta
        nodes, values = np.array([(0.0, 0.0), *self.radial_deg, (FIELD_DEG, 0.0)]).T
        return LensCurve(nodes, values, *self.decentring_deg).displaced(alpha, beta)

    def restore(self, displaced: ArrayLike) -> Angles:
        """Inverse of `displace`, to 1e-9 deg within the field."""
        apparent = np.asarray(displaced, np.float64)
        alpha, beta = first, second = np.ascontiguousarray(np.moveaxis(apparent, -1, 0))
        for _ in range(_INVERSION_STEPS):
            there = self._displaced(alpha, beta)
            missed = first - there[0], second - there[1]
            alpha, beta = alpha + missed[0], beta + missed[1]
            if not max(np.abs(one).max() for one in missed) > _INVERSION_DEG:
                break
        return np.stack([alpha, beta], axis=-1)


#: A lens that is exactly as the firmware assumes.
NOMINAL = LensError()


@lru_cache(maxsize=8)
def draw_lens(camera: CameraTarget, serial: int) -> LensError:
    """The lens of ``camera`` in the unit with that serial number."""
    rng = np.random.default_rng([serial, camera])
    centre_x, centre_y = rng.uniform(-0.5, 0.5, 2)
    p1, p2 = rng.normal(0, DECENTRING_SIGMA_DEG, 2)
    if camera is CameraTarget.SUN:
        share = rng.uniform(*SUN_SHARE)
        radial = [(angle, share * offset) for angle, offset in SUN_OFFSETS_DEG]
    else:
        errors = rng.normal(0, NADIR_SIGMA_DEG, len(NADIR_NODES_DEG))
        radial = list(zip(NADIR_NODES_DEG, errors.tolist(), strict=True))
    return LensError((centre_x, centre_y), tuple(radial), (p1, p2))
