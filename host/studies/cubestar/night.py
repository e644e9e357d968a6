"""A night on a roof: CubeStar's accuracy test (thesis, section 6.1, table 6.1).

The camera stands on the ground and looks at the zenith of Stellenbosch while the 1 Hz loop runs.
The operator first chooses a threshold with centroids like those of figure 6.1: at most 16, and
matched. Straight lines through the logged angles replace the truth.

Stated, where the thesis says nothing: 2 arcsec of seeing, 0.25 mag of extinction, a sky of 20 mag
a square arcsecond (a town's edge), 120 m of height. The lens is that of the printed calibration, to
the letter: coefficients that the toolbox fits from undistorted to distorted, used with inverted
signs the other way round. It errs most along the picture's rows. Neither how the camera was turned
is published nor the sidereal time: fields are taken every 45 deg of it, each turned by an angle
that is drawn. Through this lens lost in space, as printed, does not find the stars of every field:
one of which fewer than half of the pictures give an attitude, or whose logged angles scatter by
more than a degree, is left out, as the test can not take place there.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from cubestack.emulator.camera.common.optics import Distortion
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.scene.atmosphere import Atmosphere, earth_rate_deg_s
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.cubestar.operator import LADDER
from cubestack.host.devices.result_table import log_lines, scatter
from cubestack.host.experiments.cubestar.measure import CubeStarOpener
from cubestack.host.studies.rows.estimate import deviation

LATITUDE_DEG, HEIGHT_M, SEEING_ARCSEC, SKY_MAG = -33.93, 120.0, 2.0, 20.0
SIDEREAL_DEG = range(0, 360, 45)
QUICK_FIELD = 2
LEAST_VALID = 50.0  # percent
MOST_SCATTER_DEG = 1.0
MOST_CENTROIDS = 16  # of figure 6.1, which has 8 to 16 of one field: the threshold is chosen by it
INTERVAL_S = 3.0  # so that a hundred pictures are the published several minutes
SETTLING = 3  # lines until the loop's first attitudes are out


def night(opened: CubeStarOpener, frames: int) -> dict[str, float]:
    """Over the fields, scatter as root of the mean square; a few frames are of one, 1 s apart.

    Scatter in degrees of ``ra``, ``dec``, ``roll`` and ``across``: root of the sum of squares of
    declination and right ascension times its cosine, which does not depend on how the camera is
    turned. ``fewest`` and ``most`` stars that an attitude rests on, ``valid``, pictures with an
    attitude in percent, in the mean; and ``fields``, of how many.
    """
    condition = replace(CONDITION, optics=replace(LENS, distortion=Distortion.TOOLBOX))
    turned = np.random.default_rng(0).uniform(0, 360, len(SIDEREAL_DEG))
    fields = list(zip(SIDEREAL_DEG, turned, strict=True))
    found, whole = [], frames > SETTLING
    for sidereal_deg, roll_deg in fields if whole else fields[QUICK_FIELD : QUICK_FIELD + 1]:
        air = Atmosphere(LATITUDE_DEG, sidereal_deg, HEIGHT_M, SEEING_ARCSEC, sky_mag=SKY_MAG)
        sky = SkyScene.pointing(sidereal_deg, LATITUDE_DEG, float(roll_deg))
        sky = replace(sky, rate_deg_s=earth_rate_deg_s(sky.quaternion), atmosphere=air)
        with opened(SkyView(sky, condition), seed=0) as emulated:
            choose_threshold(emulated.client)
            emulated.client.client.command("Trigger")
            lines = log_lines(
                emulated.client,
                partial(getattr, emulated, "time_s"),
                count=max(frames, 3) + SETTLING,
                interval_s=INTERVAL_S if whole else 1.0,
            )
            good = [line for line in list(lines)[SETTLING:] if line.get("valid")]
        stars = [int(line["matched"] or 0) for line in good] or [0]
        spread = scatter(good)
        ra, dec, roll = (
            spread.get(f"{angle}_deg", (0, np.nan, 0))[1] for angle in ("ra", "dec", "roll")
        )
        across = np.hypot(ra * np.cos(np.radians(LATITUDE_DEG)), dec)
        valid = 100 * len(good) / max(frames, 3)
        if valid >= LEAST_VALID and max(roll, across) <= MOST_SCATTER_DEG:
            found.append((ra, dec, roll, across, min(stars), max(stars), valid))
    if not found:
        return {}
    columns = np.array(found).T
    pooled, means = np.sqrt(np.mean(columns[:4] ** 2, axis=1)), columns[4:].mean(axis=1)
    names = ("ra", "dec", "roll", "across", "fewest", "most", "valid")
    # Lines through the angles of each field take two degrees of freedom.
    sigmas = [deviation(float(one), max(len(found) * (frames - 2), 1)) for one in pooled]
    return dict(zip(names, [*sigmas, *map(float, means)], strict=True)) | {"fields": len(found)}


def choose_threshold(client: CubeStar) -> int:
    """Capture once and set the threshold in DN whose stars are most like figure 6.1's.

    Among those with at most ``MOST_CENTROIDS``, it has most matched and fewest other stars.
    """
    client.capture()
    best, most = LADDER[-1], -MOST_CENTROIDS
    for threshold in reversed(LADDER):
        _set_threshold(client, threshold)
        client.process_image()
        centroids = int(client.client.telemetry("DetectionSummary")["NumStarsDetected"])
        if centroids > MOST_CENTROIDS:
            break
        attitude = client.attitude()
        matched = attitude.matched if attitude.valid else 0
        if 2 * matched - centroids > most:
            best, most = threshold, 2 * matched - centroids
    _set_threshold(client, best)
    return best


def _set_threshold(client: CubeStar, threshold: int) -> None:
    both = {"DetectionThreshold": threshold, "StarThreshold": threshold}
    client.configure({"setDetectionThresholds": both})
