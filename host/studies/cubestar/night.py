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
one of which fewer than half of the pictures give an attitude, or whose logged angles scatter, or
are off, by more than a degree, is left out, as the test can not take place there.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cubestack.emulator.camera.common.optics import Distortion, Optics
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.scene.atmosphere import Atmosphere, earth_rate_deg_s
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.clients.contract import Columns
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.cubestar.operator import LADDER
from cubestack.host.devices.result_table import log_lines, scatter
from cubestack.host.experiments.cubestar.measure import CubeStarOpener
from cubestack.host.studies.rows.estimate import deviation

PRINTED_LENS = replace(LENS, distortion=Distortion.TOOLBOX)
LATITUDE_DEG, HEIGHT_M, SEEING_ARCSEC, SKY_MAG = -33.93, 120.0, 2.0, 20.0
SIDEREAL_DEG = range(0, 360, 45)
QUICK_FIELD = 2
LEAST_VALID = 50.0  # percent
MOST_SCATTER_DEG = 1.0
MOST_CENTROIDS = 16  # of figure 6.1, which has 8 to 16 of one field: the threshold is chosen by it
INTERVAL_S = 3.0  # so that a hundred pictures are the published several minutes
SETTLING = 3  # lines until the loop's first attitudes are out


@dataclass(frozen=True)
class Field:
    """One field of view: scatter in degrees, stars of an attitude, and pictures with one."""

    ra: float
    dec: float
    roll: float
    across: float
    fewest: int
    most: int
    valid: float  #: percent
    off_deg: float  #: mean declination from the zenith's

    @property
    def is_held(self) -> bool:
        """Whether the test can take place there."""
        calm = max(self.roll, self.across) <= MOST_SCATTER_DEG
        return self.valid >= LEAST_VALID and calm and self.off_deg <= MOST_SCATTER_DEG


def night(opened: CubeStarOpener, frames: int) -> dict[str, float]:
    """Over the fields, scatter as root of the mean square; a few frames are of one, 1 s apart.

    Scatter in degrees of ``ra``, ``dec``, ``roll`` and ``across``: root of the sum of squares of
    declination and right ascension times its cosine, which does not depend on how the camera is
    turned. ``fewest`` and ``most`` stars that an attitude rests on, ``valid``, pictures with an
    attitude in percent, in the mean; and ``fields``, of how many.
    """
    return pooled([one for one in fields(opened, frames, PRINTED_LENS) if one.is_held], frames)


def pooled(held: Sequence[Field], frames: int) -> dict[str, float]:
    """Figures of ``night`` over these fields; none without one."""
    if not held:
        return {}
    columns = np.array([astuple(one)[:7] for one in held]).T
    squares, means = np.sqrt(np.mean(columns[:4] ** 2, axis=1)), columns[4:].mean(axis=1)
    names = ("ra", "dec", "roll", "across", "fewest", "most", "valid")
    # Lines through the angles of each field take two degrees of freedom.
    sigmas = [deviation(float(one), max(len(held) * (frames - 2), 1)) for one in squares]
    return dict(zip(names, [*sigmas, *map(float, means)], strict=True)) | {"fields": len(held)}


def fields(
    opened: CubeStarOpener,
    frames: int,
    optics: Optics,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
) -> Iterator[Field]:
    """All fields through a lens; a few frames are of one. ``settings``: of telecommands."""
    turned = np.random.default_rng(0).uniform(0, 360, len(SIDEREAL_DEG))
    places = list(zip(SIDEREAL_DEG, turned, strict=True))
    whole = frames > SETTLING
    for sidereal_deg, roll_deg in places if whole else places[QUICK_FIELD : QUICK_FIELD + 1]:
        air = Atmosphere(LATITUDE_DEG, sidereal_deg, HEIGHT_M, SEEING_ARCSEC, sky_mag=SKY_MAG)
        sky = SkyScene.pointing(sidereal_deg, LATITUDE_DEG, float(roll_deg))
        sky = replace(sky, rate_deg_s=earth_rate_deg_s(sky.quaternion), atmosphere=air)
        view = SkyView(sky, replace(CONDITION, optics=optics))
        yield _field(logged(opened, view, frames, settings or {}), max(frames, 3))


def logged(
    opened: CubeStarOpener, view: SkyView, frames: int, settings: Mapping[str, Mapping[str, Any]]
) -> list[Columns]:
    """Lines with an attitude of the 1 Hz loop's log, of at least three lines."""
    with opened(view, seed=0) as emulated:
        if settings:
            emulated.client.configure(settings)
        choose_threshold(emulated.client)
        emulated.client.client.command("Trigger")
        lines = log_lines(
            emulated.client,
            partial(getattr, emulated, "time_s"),
            count=max(frames, 3) + SETTLING,
            interval_s=INTERVAL_S if frames > SETTLING else 1.0,
        )
        return [line for line in list(lines)[SETTLING:] if line.get("valid")]


def _field(good: Sequence[Columns], count: int) -> Field:
    """Of the lines with an attitude, out of ``count``."""
    stars = [int(line["matched"] or 0) for line in good] or [0]
    spread = scatter(good)
    ra, dec, roll = (
        spread.get(f"{angle}_deg", (0, np.nan, 0))[1] for angle in ("ra", "dec", "roll")
    )
    across = float(np.hypot(ra * np.cos(np.radians(LATITUDE_DEG)), dec))
    declination = np.mean([line["dec_deg"] for line in good]) if good else np.nan
    off_deg = abs(float(declination) - LATITUDE_DEG)
    return Field(ra, dec, roll, across, min(stars), max(stars), 100 * len(good) / count, off_deg)


def choose_threshold(client: CubeStar) -> int:
    """Capture once and set the threshold in DN whose stars are most like figure 6.1's.

    Among those with at most ``MOST_CENTROIDS``, it has most matched and fewest other stars.
    """
    client.capture()
    best, most = LADDER[-1], -MOST_CENTROIDS
    for threshold in reversed(LADDER):
        set_threshold(client, threshold)
        client.process_image()
        centroids = int(client.client.telemetry("DetectionSummary")["NumStarsDetected"])
        if centroids > MOST_CENTROIDS:
            break
        attitude = client.attitude()
        matched = attitude.matched if attitude.valid else 0
        if 2 * matched - centroids > most:
            best, most = threshold, 2 * matched - centroids
    set_threshold(client, best)
    return best


def set_threshold(client: CubeStar, threshold: int) -> None:
    """Set both thresholds of the detection, in DN."""
    both = {"DetectionThreshold": threshold, "StarThreshold": threshold}
    client.configure({"setDetectionThresholds": both})
