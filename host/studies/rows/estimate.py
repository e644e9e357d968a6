"""A measured value with the limits of its statistical error."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cubestack.host.experiments.rates import CONFIDENCE_Z, wilson

RESAMPLES = 200
LIMITS = (2.5, 97.5)  # percentiles
SEED = 0


class Estimate(float):
    """A value with its 95 % limits, nan if it has none; formatted as "94.0 (90.7 to 96.2)"."""

    low: float
    high: float

    def __new__(cls, value: float, low: float, high: float) -> "Estimate":
        made = super().__new__(cls, value)
        made.low, made.high = float(low), float(high)
        return made

    def __getnewargs__(self) -> tuple[float, float, float]:  # type: ignore[override]
        return float(self), self.low, self.high

    def __format__(self, spec: str) -> str:
        if math.isnan(self) or math.isnan(self.low):
            return format(float(self), spec)
        return f"{float(self):{spec}} ({self.low:{spec}} to {self.high:{spec}})"


def rate(outcomes: Iterable[bool | None]) -> Estimate:
    """Percentage of the outcomes that are true, with Wilson's limits; nan if there are none."""
    listed = list(outcomes)
    return rate_of(sum(map(bool, listed)), len(listed))


def rate_of(count: int, of: int) -> Estimate:
    """The same of a number of outcomes."""
    low, high = wilson(count, of)
    return Estimate(100 * count / of if of else math.nan, 100 * low, 100 * high)


def average(values: Iterable[float]) -> Estimate:
    """Mean of the values, with limits from their scatter, within their range; nan if there are
    none."""
    found = np.array(list(values), float)
    if not found.size:
        return Estimate(math.nan, math.nan, math.nan)
    half = CONFIDENCE_Z * found.std(ddof=1) / math.sqrt(found.size) if found.size > 1 else math.nan
    value = math.fsum(found) / found.size
    low, high = np.clip((value - half, value + half), found.min(), found.max())
    return Estimate(value, low, high)


def deviation(value: float, freedom: float) -> Estimate:
    """A standard deviation with ``freedom`` degrees of freedom, of values that scatter normally."""
    half = CONFIDENCE_Z / math.sqrt(2 * freedom)
    return Estimate(value, value / (1 + half), value / max(1 - half, 1e-9))


def resampled(
    summary: Callable[[Sequence[Any]], Mapping[str, float]],
    groups: Sequence[Sequence[Any]],
    extremes: Iterable[str] = (),
) -> dict[str, float]:
    """Figures of the results in all groups, with limits from groups drawn again (bootstrap).

    Args:
        summary: computes figures of results.
        groups: results that belong together, such as those of one unit; one each if none do.
        extremes: beginnings of names of figures without limits: a largest value is that of these
            results alone.
    """
    figures = dict(summary([one for group in groups for one in group]))
    rng, found = np.random.default_rng(SEED), list[Mapping[str, float]]()
    for _ in range(RESAMPLES if len(groups) > 1 else 0):
        drawn = rng.integers(len(groups), size=len(groups))
        found.append(summary([one for at in drawn for one in groups[at]]))
    for name, value in figures.items():
        known = [one[name] for one in found if not math.isnan(one[name])]
        if known and not isinstance(value, Estimate) and not name.startswith(tuple(extremes)):
            figures[name] = Estimate(value, *np.percentile(known, LIMITS))
    return figures
