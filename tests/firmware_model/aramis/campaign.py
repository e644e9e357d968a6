"""Identification rates over many random attitudes.

Run from the checkout's top folder: ``python -m tests.firmware_model.aramis.campaign [POSES]``.
"""

import sys
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.measurement import configuration
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED
from cubestack.firmware_model.aramis.settings import StoredSettings
from cubestack.firmware_model.aramis.solution import Profile
from cubestack.firmware_model.interface.aramis import MeasurementOutcome
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.mcu.memory import FlashStore

from .sky import FIELD, Light, database, in_published_sense, is_right, meter, misnamed, picture


def rates(
    poses: int,
    profile: Profile,
    light: Light | None = None,
    hint_error_deg: float | None = None,
    field: CameraField = FIELD,
    stars_per_field: int = 6,
    seed: int = 0,
) -> dict[str, float]:
    """Shares of the poses: right, wrong, ambiguous, none; `far` are wrong in the thesis' sense.

    `misnamed` counts stars a pose, `ms` is the mean time on the processor.
    """
    rng = np.random.default_rng(seed)
    onboard = database(CatalogueParameters(fov_deg=field.fov_deg, stars_per_field=stars_per_field))
    counts, spent = Counter[str](), meter()
    for _ in range(poses):
        made = picture(rng, field, light)
        hint = None if hint_error_deg is None else made.hint(hint_error_deg, rng)
        solution = identify(made.stars, field, profile, onboard, spent, hint)
        if solution.outcome is not MeasurementOutcome.CONCLUSIVE:
            counts[solution.outcome.name.lower()] += 1
            continue
        counts["right" if is_right(solution, made.attitude) else "wrong"] += 1
        counts["far"] += not in_published_sense(solution, made, onboard)
        counts["misnamed"] += misnamed(solution, made, onboard)
    names = ("right", "wrong", "ambiguous", "none", "far", "misnamed")
    result = {name: counts[name] / poses for name in names}
    return {**result, "ms": spent.table.seconds(spent.total) / poses * 1000}


#: What the thesis' simulator may have been like: its window has 582 px where ours has 1024.
COARSE = Light(noise_px=0.26 * 1024 / 582, mag_noise=0.3)
NOTHING = Light(mag_limit=-2.0, false_stars=20, false_mags=(2.0, 6.0))
PLAIN, CHECKED = PUBLISHED.profile, VERIFIED.profile
PRINTED = configuration(StoredSettings(FlashStore()), AramisSwitches.of("published")).profile
LISTED = replace(PRINTED, identities="appendix-e")
NOISES = (Light(), replace(COARSE, noise_px=0.26), COARSE, replace(COARSE, noise_px=1.0))

CASES: dict[str, tuple[Any, ...]] = {
    "published": (PLAIN,),
    "published, 2 deg hint": (PLAIN, Light(), 2.0),
    "published, noise as assumed": (PLAIN, COARSE),
    "published, noise as assumed, 2 deg hint": (PLAIN, COARSE, 2.0),
    "published, 1 px": (PLAIN, replace(COARSE, noise_px=1.0)),
    "published, 1 px, 2 deg hint": (PLAIN, replace(COARSE, noise_px=1.0), 2.0),
    "published, 5 false stars": (PLAIN, Light(false_stars=5)),
    "published, 18 deg": (PLAIN, Light(), None, CameraField(fov_deg=18)),
    **{
        f"profile published, {light.noise_px:.2g} px, hint {hint}": (PRINTED, light, hint)
        for hint in (None, 2.0)
        for light in NOISES
    },
    "the same, 0.26 px, five stars a field": (PRINTED, NOISES[1], None, FIELD, 5),
    "the same, 0.26 px, stars as in appendix E": (LISTED, NOISES[1]),
    "verified": (CHECKED,),
    "verified, 5 false": (CHECKED, Light(false_stars=5)),
    "verified, 5 false, 2 deg hint": (CHECKED, Light(false_stars=5), 2.0),
    "verified, 5 false to mag 3": (CHECKED, Light(false_stars=5, false_mags=(3.0, 4.5))),
    "verified, 5 false to mag 0": (CHECKED, Light(false_stars=5, false_mags=(0.0, 3.0))),
    "verified, 10 false": (CHECKED, Light(false_stars=10)),
    "verified, 18 deg, 5 false": (CHECKED, Light(false_stars=5), None, CameraField(fov_deg=18)),
    "verified, only to mag 5, 5 false": (CHECKED, Light(mag_limit=5.0, false_stars=5)),
    "verified, 0.3 px, 5 false": (CHECKED, Light(noise_px=0.3, false_stars=5)),
    "nothing but 20 false stars": (CHECKED, NOTHING),
}


def main(poses: int) -> None:
    for name, case in CASES.items():
        found = rates(poses, *case)
        print(f"{name:42}", *(f"{key} {value:.3f}" for key, value in found.items()), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
