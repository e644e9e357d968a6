"""What a dip of the supply does to an EFM32GG.

EFM32GG280 data sheet, table of power management; EFM32GG Reference Manual, 9.3.1 to 9.3.3. The
brown-out detector holds the part in reset from the moment when the supply falls below a threshold
until it has risen above another one. If the supply fell so far that the power-on circuit lost its
state, the cause is a power-on reset.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

POWER_ON, BROWN_OUT = 1 << 0, 1 << 1
"""Bits of RMU_RSTCAUSE: PORST, BODUNREGRST."""

SUPPLY_V = 1.98, 3.8
"""Operating range."""

FALLING_V = 1.80
"""Threshold of the falling supply: assumed, within the data sheet's 1.74 V to 1.96 V."""

RISING_V = 1.85
"""Threshold of the rising supply: the data sheet's typical value."""

RETAINED_V = 1.0
"""Below, RAM and reset causes are lost: assumed, as the data sheet has no figure."""

PS_PER_MS = 10**9

Curve = Sequence[tuple[float, float]]
"""Corners (ms, V), straight between them."""


@dataclass(frozen=True)
class Dip:
    """A dip of the supply as the part sees it; times in ps from the start of its curve."""

    reset_ps: int  #: the reset begins
    release_ps: int  #: the reset ends
    cause: int  #: bits of RMU_RSTCAUSE

    @property
    def forgets(self) -> bool:
        """Whether RAM and retention registers are lost."""
        return bool(self.cause & POWER_ON)


def dip_of(curve: Curve) -> Dip | None:
    """The first reset of a curve, None if it has none; ValueError if it never ends."""
    fallen = _crossing(curve, FALLING_V, 0.0, rising=False)
    if fallen is None:
        return None
    risen = _crossing(curve, RISING_V, fallen, rising=True)
    if risen is None:
        raise ValueError(f"the supply must end above {RISING_V} V, where the reset ends")
    lowest = min(volts for ms, volts in curve if fallen <= ms <= risen)
    cause = POWER_ON if lowest < RETAINED_V else BROWN_OUT
    return Dip(round(fallen * PS_PER_MS), round(risen * PS_PER_MS), cause)


def volts_at(curve: Curve, ms: float) -> float:
    """Supply at a time; constant before and after the curve."""
    if ms <= curve[0][0]:
        return curve[0][1]
    for (start, low), (end, high) in pairwise(curve):
        if ms <= end:
            return low + (high - low) * (ms - start) / (end - start)
    return curve[-1][1]


def _crossing(curve: Curve, level: float, after: float, *, rising: bool) -> float | None:
    """Time in ms at which the curve first crosses ``level``."""
    for (start, first), (end, last) in pairwise(curve):
        begin = max(start, after)
        if end < begin:
            continue
        at = first + (last - first) * (begin - start) / (end - start)
        crosses = at < level <= last if rising else at >= level > last
        if crosses:
            return start + (end - start) * (level - first) / (last - first)
    return None
