"""Identification alone, on star lists of random skies: how often it is right, and what else."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.measurement import configuration
from cubestack.firmware_model.aramis.settings import StoredSettings
from cubestack.firmware_model.aramis.solution import Profile
from cubestack.firmware_model.interface.aramis import MeasurementOutcome
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.host.studies.aramis.sky import (
    FIELD,
    Light,
    database,
    in_published_sense,
    is_right,
    meter,
    picture,
)
from cubestack.host.studies.rows.estimate import rate_of
from cubestack.host.studies.rows.trial import Figures


def outcomes(
    poses: int,
    profile: Profile,
    light: Light | None = None,
    hint_error_deg: float | None = None,
    field: CameraField = FIELD,
    stars_per_field: int = 6,
    seed: int = 0,
) -> Counter[str]:
    """Numbers of poses: right, wrong, ambiguous, none; `far` are wrong in the thesis' sense."""
    rng, counts, spent = np.random.default_rng(seed), Counter[str](), meter()
    onboard = database(CatalogueParameters(fov_deg=field.fov_deg, stars_per_field=stars_per_field))
    for _ in range(poses):
        made = picture(rng, field, light)
        hint = None if hint_error_deg is None else made.hint(hint_error_deg, rng)
        solution = identify(made.stars, field, profile, onboard, spent, hint)
        if solution.outcome is not MeasurementOutcome.CONCLUSIVE:
            counts[solution.outcome.name.lower()] += 1
            continue
        counts["right" if is_right(solution, made.attitude) else "wrong"] += 1
        counts["far"] += not in_published_sense(solution, made, onboard)
    return counts


PRINTED = configuration(StoredSettings(FlashStore()), AramisSwitches.of("published")).profile
"""Of the whole device."""

LISTED = replace(PRINTED, identities="appendix-e")
HINT_DEG = 2.0

#: What the thesis' simulator may have been like: its window has 582 px where ours has 1024.
COARSE = Light(noise_px=0.26 * 1024 / 582, mag_noise=0.3)
SAME_PIXELS = replace(COARSE, noise_px=0.26)
LIGHTS = {"0.1 px": Light(), "0.26 px": SAME_PIXELS, "0.46 px": COARSE}
LIGHTS |= {f"{noise:g} px": replace(COARSE, noise_px=noise) for noise in (1.0, 1.1, 1.2)}

CASES: dict[str, tuple[Any, ...]] = {
    **{name: (PRINTED, light) for name, light in LIGHTS.items()},
    "five stars a field": (PRINTED, SAME_PIXELS, None, FIELD, 5),
    "appendix E": (LISTED, SAME_PIXELS),
    **{f"{name}, hint": (PRINTED, light, HINT_DEG) for name, light in list(LIGHTS.items())[:4]},
}
"""Arguments of ``outcomes``, as on the page."""


def stars_alone(_opened: object, frames: int) -> Figures:
    """Of all cases, in %; `conclusive` are the right and the wrong ones."""
    offer_firmware_loops()
    figures = dict[str, float]()
    for name, case in CASES.items():
        found = outcomes(frames, *case)
        found["conclusive"] = found["right"] + found["wrong"]
        for ending in ("right", "wrong", "far", "ambiguous", "none", "conclusive"):
            figures[f"{name}, {ending}"] = rate_of(found[ending], frames)
    return figures
