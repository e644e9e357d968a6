"""Levels of an FPGA's pins at every step inside of a window: what happens between two events.

A trace has the pins as they stand after each event of the simulation; pixel clocks, memory cycles
and the pulses of a transfer loop are in between. A scope sees them, at a rate that is affordable
for some microseconds. The run itself stays what it is.
"""

from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import RtlEngine

Changes = dict[str, list[tuple[int, int]]]


class Scope:
    """Watches pins of an engine from ``start_ps`` to ``end_ps``; attach it before that.

    Attributes:
        changes: time in ps and new level of each pin, the first one at the window's start.
    """

    def __init__(
        self, engine: RtlEngine, pins: tuple[str, ...], start_ps: int, end_ps: int, step_ps: int
    ) -> None:
        """Sample ``pins`` every ``step_ps``; ValueError for a window that is over or empty."""
        if not engine.now_ps <= start_ps < end_ps or step_ps <= 0:
            raise ValueError(f"can not watch from {start_ps} to {end_ps} ps by {step_ps} ps")
        engine.use_strides(False)  # clocks are made one by one
        self.changes: Changes = {pin: [] for pin in pins}
        self._engine = engine
        self._next, self._end, self._step = start_ps, end_ps, step_ps
        self._run, self._strobe = engine.run, engine._strobe
        # The engine has no hook for observers but the methods themselves.
        vars(engine).update(run=self._observed_run, _strobe=self._observed_strobe)

    def close(self) -> None:
        """Detach."""
        for name in ("run", "_strobe"):
            vars(self._engine).pop(name, None)

    def _observed_run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        while self._next <= min(until_ps, self._end):
            if self._engine.now_ps <= self._next:
                if self._run(self._next, stop_on) < self._next:
                    return self._engine.now_ps
                self._look()
            self._next += self._step
        return self._run(until_ps, stop_on)

    def _observed_strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> Any:
        """Make the clocks in the window one by one, and the others as ever."""
        left = max(0, self._end - self._engine.now_ps)
        seen = min(len(out), ceil(left / period)) if self._next <= self._end else 0
        start_ps = self._engine.now_ps
        self._engine._strobe_step_by_step(out[:seen], period, fraction)
        if seen < len(out):
            whole, fraction = divmod(fraction + seen * period, 1)
            self._observed_run(start_ps + int(whole))
            self._strobe(out[seen:], period, fraction)

    def _look(self) -> None:
        for pin, changes in self.changes.items():
            level = self._engine.get_pin(pin)
            if not changes or changes[-1][1] != level:
                changes.append((self._next, level))
