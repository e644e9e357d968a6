"""The stellar gyro that the thesis proposes (section 7.2): rates of turning skies beside the truth,
a second between two images."""

from collections.abc import Sequence

import numpy as np

from cubestack.host.experiments.cubestar.measure import CubeStarResult
from cubestack.host.studies.rows.estimate import rate
from cubestack.host.studies.rows.trial import Figures, measured

RATES = (0.0, 0.1, 0.3, 1.0, 2.0)
"""In deg/s, about random axes: up to the firmware's limit."""

AXES = "xyz"
ARCSEC_PER_DEG = 3600


def rates(results: Sequence[CubeStarResult]) -> Figures:
    """Images with a rate, and with an attitude, in percent; mean and standard deviation of the
    errors about each axis in arcsec/s; percentage of the errors within claimed sigma and three."""
    found = [one for one in results if one.rate_error_deg_s and one.rate_sigma_deg_s]
    errors = np.array([one.rate_error_deg_s for one in found] or [[np.nan] * 3])
    sigmas = np.array([one.rate_sigma_deg_s for one in found] or [[np.nan] * 3])
    within = np.abs(errors) / sigmas
    figures = {
        "found": rate(one.rate_error_deg_s is not None for one in results),
        "solved": rate(one.solved for one in results),
        "inside": 100 * float(np.mean(within < 1)) if found else np.nan,
        "thrice": 100 * float(np.mean(within < 3)) if found else np.nan,
    }
    for axis, each in zip(AXES, ARCSEC_PER_DEG * errors.T, strict=True):
        figures[f"bias_{axis}"] = float(each.mean())
        figures[f"sigma_{axis}"] = float(each.std())
    return figures


GYRO = {
    f"gyro-{speed}": measured(
        "cubestar", rates, 40, 4, 20, mag_limit=3.8, turning=speed, set="gyro=on"
    )
    for speed in RATES
}
