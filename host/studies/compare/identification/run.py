"""Every method on every sky: right, wrong or refused, memory, operations and time of the part.

An answer is right if it names at least three stars, all rightly; wrong if any name is wrong.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments.rates import Outcome
from cubestack.host.studies.compare.database import Catalogue
from cubestack.host.studies.compare.identification.methods import Identifier, methods
from cubestack.host.studies.compare.skies import CASES, Case, take_image
from cubestack.host.studies.compare.study import Row
from cubestack.host.studies.compare.tracker import NONE, Image, Indices, Tracker

FEWEST = 3
"""Stars that an attitude needs without other knowledge (CubeStar thesis, section 4.3.5)."""

NOISES = 6.0
"""Standard deviations by which a rightly named star may be off, beside the margin."""


def judge(names: Indices, image: Image, tracker: Tracker, noise: float) -> Outcome:
    """What became of an image, by the truth; ``noise`` is that of the case."""
    named = np.flatnonzero(names != NONE)
    ahead = tracker.stars[names[named]].astype(np.float64) @ image.attitude.T
    apart = np.linalg.norm(ahead - image.rays[named], axis=1)
    reach = tracker.margin_rad + NOISES * noise * tracker.noise_px / tracker.focal_px
    if (apart > reach).any():
        return "wrong"
    return "right" if len(named) >= FEWEST else "refused"


def build(tracker: Tracker) -> dict[str, Identifier]:
    """The methods with their databases, by name."""
    catalogue = Catalogue(tracker)
    return {method.name: method.build(catalogue) for method in methods()}


def compare(
    tracker: Tracker,
    identifiers: Mapping[str, Identifier],
    skies: int,
    seed: int,
    cases: Sequence[Case] = CASES,
) -> Iterator[Row]:
    """Rows case by case: shares of right, refused and wrong images in percent, bytes, and mean
    operations, mean and longest time in ms of the part."""
    for case in cases:
        images = [take_image(tracker, case, seed, number) for number in range(skies)]
        for name, identify in identifiers.items():
            counts = {"right": 0, "refused": 0, "wrong": 0}
            operations, times_ms = list[int](), list[float]()
            for image in images:
                meter = Meter(tracker.table)
                names = identify(image, meter)
                counts[judge(names, image, tracker, case.noise)] += 1
                operations.append(sum(meter.counts.values()))
                times_ms.append(1000 * tracker.table.seconds(meter.total))
            figures = {outcome: 100 * count / skies for outcome, count in counts.items()}
            figures |= {
                "database_bytes": identify.database_bytes,
                "ram_bytes": identify.ram_bytes,
                "operations": float(np.mean(operations)),
                "mean_ms": float(np.mean(times_ms)),
                "longest_ms": max(times_ms),
            }
            yield Row(tracker.name, name, case.name, figures)


def run(tracker: Tracker, skies: int, seed: int) -> Iterator[Row]:
    """All methods on all cases."""
    yield from compare(tracker, build(tracker), skies, seed)
