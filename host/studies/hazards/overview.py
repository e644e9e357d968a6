"""Star trackers in a sample of hard skies: right, refused, wrong, and what they claim."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cubestack.host.experiments.attitude import AttitudeResult
from cubestack.host.experiments.hazard_options import Asked
from cubestack.host.studies.rows.estimate import rate
from cubestack.host.studies.rows.trial import Figures, Trial, measured_in_turn

HARD: Mapping[str, Mapping[str, Any]] = {
    "moon": {"hazard": (Asked("moon"),)},
    "earth-limb": {"hazard": (Asked("earth-limb", 5),)},
    "gradient": {"hazard": (Asked("gradient", 60),)},
    "protons": {"hazard": (Asked("protons", 100),)},
    "hot-pixels": {"hazard": (Asked("hot-pixels", 20_000),)},
}
"""Hazards of the overview."""


def skies(device: str, more: Mapping[str, Mapping[str, Any]]) -> Trial:
    """A star tracker in profile ``extended``: in usual skies, in those with the options ``more``
    of `cubestack measure`, and in ``HARD`` ones."""
    runs = {"usual": {}, **more, **HARD}
    return measured_in_turn(device, claims, runs, 100, 1, 5.0 * len(runs), profile="extended")


def claims(results: Sequence[AttitudeResult]) -> Figures:
    """Percentages: of the results, and of the errors about the axes within 1 and 3 claimed
    standard deviations."""
    ratios = np.array(
        [
            np.abs(np.divide(one.error_deg, one.sigma_deg))
            for one in results
            if one.error_deg is not None and one.sigma_deg is not None
        ]
    )
    inside = {
        f"inside{limit}": 100 * float(np.mean(ratios < limit)) if ratios.size else np.nan
        for limit in (1, 3)
    }
    return {
        "right": rate(one.right for one in results),
        "refused": rate(not one.solved for one in results),
        "wrong": rate(one.solved and not one.right for one in results),
        **inside,
    }
