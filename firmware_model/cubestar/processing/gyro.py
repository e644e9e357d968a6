"""The stellar gyro of switch ``gyro``: this image's stars beside those of the image before.

CubeStar thesis, section 7.2, proposes it. The stars need no names, so it runs before the
identification and whatever comes of that. All times are those of the processor's own timer.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import CameraParameters, undistort, unit_vectors
from cubestack.firmware_model.cubestar import configuration
from cubestack.firmware_model.cubestar.earlier_stars import MOST_STARS, EarlierStars
from cubestack.firmware_model.cubestar.processing.estimate import expected_errors
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.interface.cameras.mlx75412 import CRYSTAL_HZ, LINE_CLOCKS, ROWS
from cubestack.firmware_model.interface.codec.attitude_quality import log_false_alarm
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import RateOutcome
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.gyro import (
    FEWEST_STARS,
    BodyRate,
    TimedStars,
    rate_between,
)

#: Time between two images in us above which they are not compared: a missed iteration is allowed.
LONGEST_US = 2_500_000

#: Of a search without error estimates: less than in an attitude, as the lens displaces a star alike
#: in both images.
CENTROID_ERROR_PX = 0.1

NO_RATE: dict[str, Value] = INTERFACE.telemetry("StellarGyro").reset_values()
"""Values of telemetry StellarGyro before any image."""

_ROW_S = np.float32(LINE_CLOCKS / CRYSTAL_HZ)


def measure_rate(state: State, results: Results, meter: Meter) -> dict[str, Value]:
    """Values of telemetry StellarGyro for the image of ``results``, whose stars ``state`` keeps for
    the next one."""
    earlier, detection = state.earlier, results.detection
    values = NO_RATE | {"FrameCounter": results.frame, "Compared": len(earlier.centroids)}
    outcome, rate = _compare(state, results, meter)
    values |= {"Outcome": outcome, "Interval": earlier.apart_us if rate is not None else 0}
    if rate is not None:
        values |= _shown(rate)
        meter.charge(f32_sqrt=3)
    if detection is not None:
        earlier.stars_us = earlier.image_us
        earlier.centroids = _brightest(detection.centroids, detection.intensities, meter)
    return values


def _compare(state: State, results: Results, meter: Meter) -> tuple[RateOutcome, BodyRate | None]:
    earlier, detection = state.earlier, results.detection
    if not earlier.image_us:
        return RateOutcome.UNTIMED, None
    if not earlier.stars_us or earlier.stars_us == earlier.image_us:
        return RateOutcome.NO_EARLIER_IMAGE, None
    if earlier.apart_us > LONGEST_US:
        return RateOutcome.TOO_FAR_APART, None
    stars = len(earlier.centroids), len(results.vectors)
    if detection is None or min(stars) < FEWEST_STARS:
        return RateOutcome.TOO_FEW_STARS, None
    camera = configuration.camera_parameters(state.settings)
    rate = rate_between(
        _seen(earlier, camera, meter),
        TimedStars(results.vectors, _late(detection.centroids, meter)),
        expected_errors(results, np.arange(stars[1]), camera, meter, unknown_px=CENTROID_ERROR_PX),
        earlier.apart_us / 1e6,
        meter,
        margin_rad=float(state.settings.get("setIDMargin", "Margin")),
        solid_angle_sr=configuration.field(state.settings).solid_angle_sr,
    )
    return (RateOutcome.UNMATCHED if rate is None else RateOutcome.MEASURED), rate


def _seen(earlier: EarlierStars, camera: CameraParameters, meter: Meter) -> TimedStars:
    points = undistort(earlier.centroids, camera, meter)
    return TimedStars(unit_vectors(points, camera, meter), _late(earlier.centroids, meter))


def _late(centroids: NDArray[np.float32], meter: Meter) -> NDArray[np.float32]:
    """The rolling shutter exposes row after row; an image's time is that of the middle row."""
    meter.charge(f32_mul=len(centroids), f32_add=len(centroids), loop=len(centroids))
    return np.asarray((centroids[:, 1] - np.float32(ROWS / 2)) * _ROW_S, np.float32)


def _brightest(
    centroids: NDArray[np.float32], intensities: NDArray[np.uint16], meter: Meter
) -> NDArray[np.float32]:
    order = np.argsort(-intensities.astype(int), kind="stable")[:MOST_STARS]
    looked_at = len(order) * len(intensities)  # one pass for each
    meter.charge(ram_read=looked_at, i32_add=looked_at, loop=looked_at, ram_write=len(order))
    return centroids[order]


def _shown(rate: BodyRate) -> dict[str, Value]:
    sigmas = np.sqrt(np.diag(rate.covariance))
    return {
        **{f"Rate{axis}": float(one) for axis, one in zip("XYZ", rate.rate_rad_s, strict=True)},
        **{f"Sigma{axis}": float(one) for axis, one in zip("XYZ", sigmas, strict=True)},
        "Matched": rate.matched,
        "Residual": rate.residual_rad,
        "LogFalseAlarm": log_false_alarm(rate.false_alarm),
    }
