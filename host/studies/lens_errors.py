"""Count what star trackers believe with a lens that is not as described.

Random skies pass through camera, FPGA, firmware and serial line, with one error of the lens
(``emulator.camera.common.hazards.lenses``). Unlike ``hazards``, which asks whether an attitude is
right, this asks whether its claim is.
"""

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cubestack.host.devices.registry import device as registered
from cubestack.host.experiments.attitude import AttitudeResult
from cubestack.host.experiments.hazard_options import Asked
from cubestack.host.experiments.measure import measure
from cubestack.host.experiments.rates import outcome, why_refused
from cubestack.host.studies.rows.estimate import rate_of
from cubestack.host.studies.rows.trial import Figures

RECORD = "lens-errors.jsonl"  #: in ``docs/data``: a ``LensRow`` per line

SEED = 11  #: of ``by_strength``

SIGMAS = 4.0  #: claimed standard deviations about an axis that a believed attitude may be off


@dataclass(frozen=True)
class LensCount:
    """Numbers of skies."""

    skies: int
    right: int
    refused: int  #: because of the lens
    unmatched: int  #: without an attitude for another reason
    off: int  #: believed, and not right
    outside: int  #: believed, and beyond ``SIGMAS`` of its claim
    sigma_deg: float  #: median of the believed attitudes' largest claim across the boresight


def count(device: str, hazard: str | None, strength: float, skies: int, seed: int) -> LensCount:
    """Measure skies by profile ``extended``; ``hazard``: None for the lens as described."""
    asked = () if hazard is None else (Asked(hazard, strength),)
    found = measure(device, frames=skies, seed=seed, profile="extended", hazard=asked)
    return counted(one for one in found if isinstance(one, AttitudeResult))


def counted(results: Iterable[AttitudeResult]) -> LensCount:
    ended: Counter[str] = Counter()
    outside, across = 0, []
    for result in results:
        ending: str = outcome(result)
        if ending == "refused":
            ending = "lens" if why_refused(result) == "lens" else "unmatched"
        ended[ending] += 1
        if result.solved and result.sigma_deg is not None and result.error_deg is not None:
            outside += is_outside(result)
            across.append(max(result.sigma_deg[:2]))
    return LensCount(
        skies=ended.total(),
        right=ended["right"],
        refused=ended["lens"],
        unmatched=ended["unmatched"],
        off=ended["wrong"],
        outside=outside,
        sigma_deg=float(np.median(across)) if across else 0.0,
    )


def is_outside(result: AttitudeResult) -> bool:
    """Whether the error about an axis exceeds the claim of a believed attitude."""
    sigmas, errors = result.sigma_deg or [], result.error_deg or []
    return any(abs(e) > SIGMAS * s for e, s in zip(errors, sigmas, strict=True))


def by_strength(
    _opened: object, frames: int, *, device: str, hazard: str, strengths: tuple[float, ...]
) -> Figures:
    """Right attitudes in % of the skies, and numbers of the others, by the strength of an error."""
    figures = dict[str, float]()
    for strength in strengths:
        found = count(device, hazard, strength, frames, SEED)
        figures[f"{strength:g} right"] = rate_of(found.right, found.skies)
        for name in ("refused", "unmatched", "off", "outside"):
            figures[f"{strength:g} {name}"] = getattr(found, name)
    return figures


@dataclass(frozen=True)
class LensRow:
    """A row of the page: one error of the lens of a device, over several seeds."""

    device: str
    hazard: str | None
    strength: float
    seeds: list[int]
    count: LensCount

    @property
    def line(self) -> str:
        lens = "as described" if self.hazard is None else f"`{self.hazard}={self.strength:g}`"
        one = self.count
        numbers = (one.skies, one.right, one.refused, one.unmatched, one.off, one.outside)
        cells = (registered(self.device).title, lens, *numbers, f"{one.sigma_deg:.2g} deg")
        return "| " + " | ".join(map(str, cells)) + " |"


def rows(text: str) -> list[LensRow]:
    """The rows of a record."""
    found = [json.loads(line) for line in text.splitlines()]
    return [LensRow(**{**one, "count": LensCount(**one["count"])}) for one in found]
