"""Figures of the upsets of a device: by register and memory, and of all."""

from collections import Counter
from typing import Any

from cubestack.host.studies.rows.estimate import rate_of
from cubestack.host.studies.rows.trial import Figures
from cubestack.host.studies.upsets.atlas import BAD, atlas
from cubestack.host.studies.upsets.experiment import UpsetExperiment
from cubestack.host.studies.upsets.sample import EFFECTS, UpsetResult

FEW = "*ack"
"""Registers of a run without scenes."""


def upset_figures(opened: Any, frames: int, *, experiment: UpsetExperiment) -> Figures:
    """Each bit once in each phase, in ``frames`` scenes; without any, only a few registers.

    By register and memory: numbers of bits and upsets, noticed ones per day, percentages that the
    processor noticed, and of answers that were refused and wrong. Of all: these percentages, and
    the number of each effect.
    """
    results = list[UpsetResult]()
    for seed in range(max(frames, 1)):
        some = {} if frames else {"registers": FEW}
        results += experiment.run(opened, experiment.options(frames=1, seed=seed, **some))  # type: ignore[arg-type]
    figures: dict[str, float] = {}
    parts = atlas(results)
    for part in parts:
        count = len(part.results)
        figures |= {f"{part.name} bits": part.bits, f"{part.name} upsets": count}
        figures[f"{part.name} seen"] = rate_of(part.seen, count)
        figures[f"{part.name} a day"] = part.a_day
        figures |= {f"{part.name} {one}": rate_of(part.answers[one], count) for one in BAD}
    answers = Counter(one.answer for one in results)
    effects = Counter(one.effect for one in results)
    figures |= {f"all {one}": rate_of(answers[one], len(results)) for one in BAD}  # type: ignore[index]
    figures |= {f"all {effect}": effects[effect] for effect in EFFECTS}
    figures["all a day"] = sum(part.a_day for part in parts)
    figures["all upsets"] = len(results)
    figures["all seen"] = rate_of(sum(part.seen for part in parts), len(results))
    return figures
