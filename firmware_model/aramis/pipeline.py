"""From a picture to an attitude.

AraMiS thesis, figure 8.1 and section 7.3: threshold over five pictures, spike removal, centroids,
identification and attitude.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.detection import charges
from cubestack.firmware_model.aramis.detection.mask import (
    HALF,
    LevelHistory,
    SpikeRemoval,
    remove_spikes,
)
from cubestack.firmware_model.aramis.detection.regions import NO_REGIONS, find_regions, locate_stars
from cubestack.firmware_model.aramis.detection.spots import find_spots, smear_px, without_tracks
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.solution import (
    PictureLight,
    Profile,
    Solution,
    StarList,
    unsolved,
)
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.background import (
    UNIT,
    cell_middles,
    estimate,
    sample_offsets,
)
from cubestack.firmware_model.star_tracker.quality import DisturbanceLimits
from cubestack.firmware_model.values import DeclaredValues, flag, number, whole

STEP = 2  #: distance of the background's samples in px

#: In 1/16 count: the converter's steps hide less, and levels near 0 are cut off there.
LEAST_NOISE = 19

BLIND = 240  #: level from which no star differs from its surroundings
SPIKE_SIGMAS = 8.0  #: lowest excess of a spike over its surroundings, in standard deviations


#: Shares of the field: the Moon's disc with its glare, not a bright star; the Earth on a third of
#: it. Counts: a dark sky stays below. Hot pixels and particles: one in a window of 25, which
#: distinguishes a spike from a star. Emulated skies below these limits are solved.
LIMITS = DisturbanceLimits(
    saturated=0.004, background=20.0, background_range=10.0, enough=25, blind=0.3, spikes=33_000
)

WIDE_PX = 2500  #: a bright region that no star fills

#: Of a search that found no attitude, which says nothing of the cause.
_OPEN = (Reason.UNCONFIRMED, Reason.NO_TRIANGLE, Reason.NO_TIME, Reason.TOO_FEW_STARS)


@dataclass(frozen=True)
class DetectionSettings(DeclaredValues):
    """Settings of the search for stars; the defaults are the published ones.

    ``spikes`` says how noise is removed. The limits of a star's size and of the number of stars
    are assumed; the thesis has none.
    """

    sigmas: float = number(2.0, "standard deviations of a bright pixel above the mean", 0, 20)
    spikes: SpikeRemoval = SpikeRemoval.WINDOW
    needed: int = whole(HALF, "bright pixels that a window of 25 must have", 1, 25)
    min_pixels: int = whole(1, "smallest star", 1, 1_000_000, "px")
    max_pixels: int = whole(2500, "largest star", 1, 1_000_000, "px")
    max_stars: int = whole(30, "the brightest are kept", 3, 255)
    subtract: bool = flag(False, "take off the mean level before weighing (an extension)")
    local: bool = flag(
        False, "a threshold for every place, and stars by their shape (an extension)"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_within("min_pixels", high=self.max_pixels)


_FIELD, _DETECTION, _PROFILE = CameraField(), DetectionSettings(), Profile()


@dataclass(frozen=True)
class Configuration:
    """Everything that is set before flight."""

    field: CameraField = _FIELD
    detection: DetectionSettings = _DETECTION
    profile: Profile = _PROFILE


PUBLISHED = Configuration()  #: as the thesis runs it: a unique triangle is believed

#: An extension: further stars must confirm the attitude; noise of 0.15 px is expected.
VERIFIED = replace(
    PUBLISHED,
    detection=DetectionSettings(
        spikes=SpikeRemoval.CENTRE, min_pixels=1, max_stars=60, subtract=True, local=True
    ),
    profile=Profile(sigma_rad=5.6e-5, verify=True),
)


def _check_size(picture: NDArray[np.uint8], field: CameraField) -> None:
    if picture.shape != (field.rows, field.columns):
        raise ValueError(
            f"a picture must have {field.rows} rows of {field.columns} pixels, not {picture.shape}"
        )


def _without_spikes(mask: Mask, settings: DetectionSettings, meter: Meter) -> Mask:
    with meter.phase("spikes"):
        stars, cleared = remove_spikes(mask, settings.spikes, settings.needed)
        rows, columns = mask.shape
        charges.charge_spikes((rows, columns), settings.spikes, cleared, meter)
    return stars


def detect(
    picture: NDArray[np.uint8],
    background: LevelHistory,
    field: CameraField,
    settings: DetectionSettings,
    meter: Meter,
) -> StarList | None:
    """Stars of a picture (rows, columns) in the field; None when too many pixels are lit. The
    picture is added to `background`. Phases: `threshold`, `spikes`, `centroids`. Raises ValueError
    for a picture of another size than the field's."""
    _check_size(picture, field)
    with meter.phase("threshold"):
        background.add(picture, field, meter)
        level = background.threshold(settings.sigmas, meter)
        mask = (picture > level) & field.mask
        pixels = field.pixels
        meter.charge(pixel_read=pixels, i32_add=pixels, ram_write=picture.size // 4, loop=pixels)
    mask = _without_spikes(mask, settings, meter)
    with meter.phase("centroids"):
        regions = find_regions(mask)
        charges.charge_regions(mask.size, regions, meter)
        if regions is None:
            return None
        floor = background.mean(meter) if settings.subtract else 0
        stars = locate_stars(picture, regions, floor, settings.min_pixels, settings.max_pixels)
        charges.charge_centroids(regions, len(stars), meter)
        inside = np.flatnonzero(field.inside(stars.centroids, meter))[: settings.max_stars]
        smear = smear_px(picture, regions, background.mean(meter))
        charges.charge_smear(regions, meter)
    return StarList(stars.centroids[inside], stars.brightness[inside], smear)


def solve(
    picture: NDArray[np.uint8],
    background: LevelHistory,
    configuration: Configuration,
    database: Database,
    meter: Meter,
    hint: Floats | None = None,
    exposure_rows: int | None = None,
) -> Solution:
    """Attitude of a picture (rows, columns), or why there is none.

    Without a local threshold the picture is added to ``background``. ``hint`` (3,) is a rough unit
    vector of the boresight in inertial axes; None: lost in space. ``exposure_rows``: exposure of
    each row in row times; None: all rows at once. Raises ValueError for a picture of another size.
    """
    field, profile = configuration.field, configuration.profile
    until = meter.total + profile.within_ms * meter.table.clock_hz / 1000
    if configuration.detection.local:
        stars = detect_locally(picture, field, configuration.detection, meter)
    else:
        found = detect(picture, background, field, configuration.detection, meter)
        if found is None:
            nothing = StarList(np.zeros((0, 2), np.float32), np.zeros(0, np.float32))
            return unsolved(Reason.TOO_MANY_PIXELS, nothing)
        stars = found
    if exposure_rows is not None:
        stars = replace(stars, skew_px=stars.smear_px * field.rows / exposure_rows)
    solution = identify(stars, field, profile, database, meter, hint, until)
    return replace(solution, reason=true_reason(solution))


def detect_locally(
    picture: NDArray[np.uint8], field: CameraField, settings: DetectionSettings, meter: Meter
) -> StarList:
    """Stars of a picture (rows, columns) in the field, and its light. Phases and errors as
    ``detect``."""
    _check_size(picture, field)
    with meter.phase("threshold"):
        rows, columns = picture.shape
        down, across = sample_offsets(rows, columns, STEP)
        samples = picture.take(down, axis=0).take(across, axis=1)
        sky = estimate(samples, STEP, LEAST_NOISE).smoothed()
        charges.charge_background(sky, meter)
        mask = sky.brighter(picture, settings.sigmas) & field.mask
        far = sky.brighter(picture, SPIKE_SIGMAS) & field.mask
        for _ in (mask, far):
            charges.charge_thresholds(rows, columns, meter)
    large = _without_spikes(mask, settings, meter)
    spikes = int(np.count_nonzero(far & ~large))
    with meter.phase("centroids"):
        regions = find_regions(large & field.mask)
        charges.charge_regions(mask.size, regions, meter)
        regions = regions or NO_REGIONS
        seen = field.mask[np.ix_(cell_middles(rows), cell_middles(columns))]
        levels, noise = sky.levels[seen] / UNIT, float(np.median(sky.noises[seen])) / UNIT
        sizes = settings.min_pixels, settings.max_pixels
        spots = find_spots(picture, regions, noise, sizes)
        charges.charge_spots(regions, sizes, spots, meter)
        spots = spots.of(field.inside(spots.centroids, meter))
        charges.charge_tracks(spots, meter)
        stars, smear_px = without_tracks(spots, field)
        low, level, high = np.percentile(levels, (5, 50, 95)).tolist()
        light = PictureLight(
            background=level,
            background_range=high - low,
            noise=noise,
            saturated=float(np.mean(levels >= BLIND)),
            spikes=spikes,
            threshold=level + settings.sigmas * noise,
            widest=spots.widest,
            rejected=spots.rejected,
        )
        kept = stars.of(np.arange(min(len(stars), settings.max_stars)))
    return StarList(kept.centroids, kept.brightness, smear_px, sigma_px=kept.sigma_px, light=light)


def true_reason(solution: Solution) -> Reason:
    """The reason of a solution; without attitude, what disturbed the picture and explains it."""
    light = solution.measured.light
    found = solution.outcome is not MeasurementOutcome.NONE
    if light is None or found or solution.reason not in _OPEN:
        return solution.reason
    stars = len(solution.measured)
    disturbance = LIMITS.exceeded(light, stars, large=light.widest > WIDE_PX)
    return solution.reason if disturbance is None else Reason[disturbance.name]
