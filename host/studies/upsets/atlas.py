"""The atlas of upsets: effects and daily rates by register and memory.

A particle flips a bit with a probability given by the bit's cross-section. The daily rate is flux
times cross-section times bits times the effect's share in each phase, weighted by its duration.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.upsets.sample import EFFECTS, UpsetResult

_NUMBER = re.compile(r"\$\d+")

BAD = ("refused", "wrong")
HEAD = ("", "bits", "upsets", *EFFECTS, "seen, 95 %", *BAD, "right in the next loop", "seen a day")


@dataclass(frozen=True)
class Part:
    """Upsets of one register or memory; ``results`` has them."""

    name: str
    results: Sequence[UpsetResult]

    @property
    def bits(self) -> int:
        return self.results[0].bits

    @cached_property
    def effects(self) -> Counter[str]:
        return Counter(one.effect for one in self.results)

    @cached_property
    def answers(self) -> Counter[str]:
        return Counter(one.answer for one in self.results)

    @property
    def seen(self) -> int:
        return sum(map(_is_seen, self.results))

    @property
    def healed(self) -> tuple[int, int]:
        """Answers not right but right in the next loop, and all that were not right."""
        bad = [one for one in self.results if one.answer in BAD]
        return sum(one.recovered == 1 for one in bad), len(bad)

    @property
    def a_day(self) -> float:
        """Number of noticed upsets per day."""
        found: dict[str, list[UpsetResult]] = {}
        for one in self.results:
            found.setdefault(one.phase, []).append(one)
        shares = _shares(self.results)
        chance = sum(
            shares.get(phase, 0.0) * sum(map(_is_seen, hit)) / len(hit)
            for phase, hit in found.items()
        )
        return self.results[0].hits_a_day * self.bits * chance


def atlas(results: Iterable[UpsetResult]) -> list[Part]:
    """A part per register and memory, by name."""
    found: dict[str, list[UpsetResult]] = {}
    for result in results:
        found.setdefault(plain(result.target), []).append(result)
    return [Part(name, hit) for name, hit in sorted(found.items())]


def rows(parts: Sequence[Part]) -> Iterator[list[str]]:
    """Cells below `HEAD`, and a last row of all parts."""
    for part in parts:
        low, high = (100 * limit for limit in wilson(part.seen, len(part.results)))
        healed, bad = part.healed
        yield [
            part.name,
            str(part.bits),
            str(len(part.results)),
            *(str(part.effects[effect]) for effect in EFFECTS),
            f"{low:.1f}-{high:.1f} %",
            *(str(part.answers[answer]) for answer in BAD),
            f"{healed} of {bad}" if bad else "",
            f"{part.a_day:.2g}",
        ]
    total = sum(part.a_day for part in parts)
    counted = [str(sum(part.effects[effect] for part in parts)) for effect in EFFECTS]
    answers = [str(sum(part.answers[answer] for part in parts)) for answer in BAD]
    count = sum(len(part.results) for part in parts)
    yield ["all", "", str(count), *counted, "", *answers, "", f"{total:.2g}"]


def lines(results: Iterable[UpsetResult]) -> Iterator[str]:
    for part in atlas(results):
        effects = ", ".join(f"{part.effects[e]} {e}" for e in EFFECTS if part.effects[e])
        answers = "".join(f", {part.answers[a]} answers {a}" for a in BAD if part.answers[a])
        low, high = (100 * limit for limit in wilson(part.seen, len(part.results)))
        yield (
            f"{part.name}: of {len(part.results)} upsets {effects}{answers}; seen {low:.1f} to "
            f"{high:.1f} %, {part.a_day:.2g} a day"
        )


def plain(target: str) -> str:
    """A register's path without the numbers of unique names."""
    return _NUMBER.sub("", target)


def _is_seen(result: UpsetResult) -> bool:
    return result.effect not in ("nothing", "left over") or result.answer != "right"


def _shares(results: Sequence[UpsetResult]) -> dict[str, float]:
    """Mean share of time of each phase over the loops of ``results``."""
    found: dict[str, float] = {}
    for one in results:
        whole_s = sum(one.phases_s.values())
        for phase, seconds in one.phases_s.items():
            found[phase] = found.get(phase, 0.0) + seconds / whole_s / len(results)
    return found
