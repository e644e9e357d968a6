"""Samples an FPGA's pins within a window of time, between the events of the simulation.

A trace has the levels after each event of the simulation; pixel clocks, memory cycles and the
pulses of a transfer loop happen in between. A scope records them, at a cost that allows windows of
some microseconds. It does not change the run.
"""

from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import RtlEngine

Changes = dict[str, list[tuple[int, int]]]


class Scope:
    """Samples pins of an engine from ``start_ps`` to ``end_ps``; attach it before that.

    Attributes:
        changes: per pin, times in ps and new levels; the first one is at the window's start.
    """

    def __init__(
        self, engine: RtlEngine, pins: tuple[str, ...], start_ps: int, end_ps: int, step_ps: int
    ) -> None:
        """Sample ``pins`` every ``step_ps``; ValueError for an empty or past window."""
        if not engine.now_ps <= start_ps < end_ps or step_ps <= 0:
            window = f"empty or past scope window: {start_ps} to {end_ps} ps, step {step_ps} ps"
            raise ValueError(f"{window}; the time is {engine.now_ps} ps")
        engine.use_strides(False)  # run each clock singly
        self.changes: Changes = {pin: [] for pin in pins}
        self._engine = engine
        self._next, self._end, self._step = start_ps, end_ps, step_ps
        self._run, self._strobe = engine.run, engine._strobe
        # The engine has no hook for observers but the methods themselves.
        vars(engine).update(run=self._observed_run, _strobe=self._observed_strobe)

    def close(self) -> None:
        for name in ("run", "_strobe"):
            vars(self._engine).pop(name, None)

    def _observed_run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        while self._next <= min(until_ps, self._end):
            if self._engine.now_ps <= self._next:
                if self._run(self._next, stop_on) < self._next:
                    return self._engine.now_ps
                self._sample()
            self._next += self._step
        return self._run(until_ps, stop_on)

    def _observed_strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> Any:
        """Run the clocks in the window step by step, and the others as usual."""
        left = max(0, self._end - self._engine.now_ps)
        watched = min(len(out), ceil(left / period)) if self._next <= self._end else 0
        start_ps = self._engine.now_ps
        self._engine._strobe_step_by_step(out[:watched], period, fraction)
        if watched < len(out):
            whole, fraction = divmod(fraction + watched * period, 1)
            self._observed_run(start_ps + int(whole))
            self._strobe(out[watched:], period, fraction)

    def _sample(self) -> None:
        for pin, changes in self.changes.items():
            level = self._engine.get_pin(pin)
            if not changes or changes[-1][1] != level:
                changes.append((self._next, level))
