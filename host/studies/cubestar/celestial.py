"""The celestial-fixed test: CubeStar on a telescope that follows the stars (thesis, section 6.1 and
figure 6.4).

The telescope stands upright and follows in azimuth and altitude, so the field turns about the
boresight: right ascension and declination stay, rotation changes. The drive is perfect here.
Stated, where the thesis says nothing: the atmosphere of the night study, the field on the meridian
45 deg north of the zenith, and a lens as calibrated, as the printed one loses most fields.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.atmosphere import Atmosphere
from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.clients.contract import Columns
from cubestack.host.devices.result_table import scatter
from cubestack.host.experiments.cubestar.measure import CubeStarOpener
from cubestack.host.studies.cubestar.night import (
    HEIGHT_M,
    LATITUDE_DEG,
    LEAST_VALID,
    MOST_SCATTER_DEG,
    QUICK_FIELD,
    SEEING_ARCSEC,
    SETTLING,
    SIDEREAL_DEG,
    SKY_MAG,
    logged,
)
from cubestack.host.studies.rows.estimate import average
from cubestack.host.studies.rows.trial import Figures

ZENITH_DISTANCE_DEG = 45.0
ANGLES = ("ra", "dec", "roll")


def celestial(opened: CubeStarOpener, frames: int) -> Figures:
    """Drift in deg/h and scatter in deg of each angle, in the mean over the fields where the test
    can take place, as for a fixed camera; ``turning`` of the scene about the boresight in deg/h;
    number of ``fields``."""
    whole, found = frames > SETTLING, list[Sequence[float]]()
    for sidereal_deg in SIDEREAL_DEG if whole else [SIDEREAL_DEG[QUICK_FIELD]]:
        scene = followed(sidereal_deg)
        good = logged(opened, SkyView(scene, CONDITION), frames, {})
        angles = _drifts(good)
        enough = 100 * len(good) / max(frames, 3) >= LEAST_VALID
        if enough and max(angles[len(ANGLES) :]) <= MOST_SCATTER_DEG:
            found.append([*angles, -3600 * np.asarray(scene.rate_deg_s)[2]])
    names = [*(f"{one}_drift" for one in ANGLES), *ANGLES, "turning"]
    columns = np.array(found).T if found else np.full((len(names), 1), np.nan)
    means = {name: average(map(float, each)) for name, each in zip(names, columns, strict=True)}
    return means | {"fields": len(found)}


def _drifts(good: Sequence[Columns]) -> list[float]:
    """Trends in deg/h and standard deviations in deg."""
    lines = scatter(good)
    each = [lines.get(f"{one}_deg", (np.nan, np.nan, 0)) for one in ANGLES]
    return [3600 * one[0] for one in each] + [one[1] for one in each]


def followed(sidereal_deg: float) -> SkyScene:
    """The sky of a telescope that stands upright; the zenith is at ``sidereal_deg`` at time 0."""
    air = Atmosphere(LATITUDE_DEG, sidereal_deg, HEIGHT_M, SEEING_ARCSEC, sky_mag=SKY_MAG)
    declination_deg = LATITUDE_DEG + ZENITH_DISTANCE_DEG
    start = SkyScene.pointing(sidereal_deg, declination_deg)
    axes = matrix_from_quaternion(start.quaternion)
    sides = [axes @ air.zenith(time_s) for time_s in (0.0, 1.0)]
    angles = [np.degrees(np.arctan2(side[1], side[0])) for side in sides]  # x right, y down
    return replace(start, rate_deg_s=(0.0, 0.0, float(angles[1] - angles[0])), atmosphere=air)
