"""Planets and the Moon as known objects (section 7.2): the same skies with switch ``bodies`` off
and on, lost in space; the host lists each with an error of 10 arcsec."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from cubestack.firmware_model.interface.cubestar import Disc
from cubestack.host.experiments.cubestar.measure import CubeStarResult
from cubestack.host.experiments.hazard_options import Asked
from cubestack.host.studies.rows.estimate import rate
from cubestack.host.studies.rows.trial import Figures, Trial, measured

#: A planet of V = -2.5, the full Moon, and a fifth of it lit, anywhere in the image.
SKIES = {
    "planet": Asked("planets", -2.5),
    "full": Asked("moon", 1.0),
    "crescent": Asked("moon", 0.2),
}

CONFIRMED = Disc.CONFIRMED.name.lower()


def outcomes(results: Sequence[CubeStarResult]) -> Figures:
    """Percentages: right, wrong and refused; planet named in a right attitude; Moon's disc
    confirmed by one."""
    right = [one for one in results if one.right]
    return {
        "right": rate(one.right for one in results),
        "wrong": rate(one.solved and not one.right for one in results),
        "refused": rate(not one.solved for one in results),
        "named": rate(bool(one.planets) for one in right),
        "disc": rate(one.disc == CONFIRMED for one in right),
    }


FRAMES, SEED = 40, 1


def _trial(asked: Asked, value: str) -> Trial:
    options: dict[str, Any] = {"mag_limit": 3.8, "hazard": (asked,), "set": f"bodies={value}"}
    trial = measured("cubestar", outcomes, FRAMES, 4, 20, SEED, **options)
    command = f"measure cubestar --frames {FRAMES} --seed {SEED} --mag-limit 3.8"
    return replace(trial, command=f"{command} --hazard {asked} --set bodies={value}")


BODIES = {
    f"bodies-{name}-{value}": _trial(asked, value)
    for name, asked in SKIES.items()
    for value in ("off", "on")
}
