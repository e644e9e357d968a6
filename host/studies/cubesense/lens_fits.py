"""What the thesis' calibration of the lens would find (sections 5.2.1 and 5.3).

A stage turns the camera every 5 deg, and the image of a dot on a far wall is noted in whole pixels.
Polynomials are fitted to its distance from the boresight.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.ov7620.fisheye import LENSES, PIXELS_PER_DEGREE, Fisheye, lens_of
from cubestack.emulator.camera.ov7620.lens_error import FIELD_DEG, NOMINAL, draw_lens
from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.host.experiments.cubesense.measure import CubeSenseOpener
from cubestack.host.studies.rows.estimate import resampled
from cubestack.host.studies.rows.trial import Figures

STEP_DEG = 5.0
ANGLES_DEG = np.arange(0.0, FIELD_DEG + STEP_DEG / 2, STEP_DEG)
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1))
ORDERS = (2, 3)
SERIALS = range(2, 12)  # the units of the pages' other rows

Radii = NDArray[np.float64]


def noted_radii(lens: Fisheye) -> Radii:
    """Distances (4, 20) of the dot from the boresight of table 5.1, by direction and angle, px."""
    nominal, field = LENSES[CameraTarget.NADIR], ANGLES_DEG * (1 - 1e-12)  # the rim is inside
    dots = [
        lens.project(vector_from_angles(x * angle, y * angle))
        for x, y in DIRECTIONS
        for angle in field
    ]
    away = np.round(np.array(dots, float)) - (nominal.cx, nominal.cy)
    return np.hypot(away[:, 0], away[:, 1]).reshape(len(DIRECTIONS), -1)


def fitted(radii: Radii, order: int) -> NDArray[np.float64]:
    """Coefficients of `radii` over the undistorted radius, highest power first."""
    ideal = np.tile(ANGLES_DEG * PIXELS_PER_DEGREE, len(radii))
    return np.asarray(np.polyfit(ideal, radii.ravel(), order))


def _figures(units: Sequence[Radii]) -> Figures:
    """Errors of the fits in px, and degrees per pixel at both ends of the field."""
    figures: dict[str, float] = {}
    for order in ORDERS:
        off = [
            radii - np.polyval(fitted(radii, order), ANGLES_DEG * PIXELS_PER_DEGREE)
            for radii in units
        ]
        figures[f"rms_{order}"] = float(np.sqrt(np.mean(np.square(off))))
        figures[f"worst_{order}"] = float(np.abs(off).max())
    coarse = STEP_DEG / np.diff(np.mean(units, axis=(0, 1)))
    return figures | {"first": float(coarse[0]), "last": float(coarse[-1])}


def lens_fits(opened: CubeSenseOpener, _frames: int) -> Figures:
    """Ten units in profile ``published``; the polynomial's own lens in ``extended``."""
    errors = [draw_lens(CameraTarget.NADIR, serial) for serial in SERIALS]
    if opened.board["profile"] != "published":
        errors = [NOMINAL]
    lenses = [lens_of(CameraTarget.NADIR, error) for error in errors]
    return resampled(_figures, [[noted_radii(lens)] for lens in lenses], ("worst",))
