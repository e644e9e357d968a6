"""The reference engine: the design in Amaranth's own simulator, the SRAM in Python."""

from fractions import Fraction
from typing import Any

import numpy as np
from amaranth.sim import Simulator
from numpy.typing import NDArray

from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.emulator.rtl.stepping import Outcome, SteppingEngine
from cubestack.emulator.sram import Sram, SramPins, SramTiming, ViolationLog
from cubestack.hdl.cubestar_top import CubeStarTop

__all__ = ["SETTLING_CLOCKS", "SimulatedEngine"]

#: After as many clocks with HSYNC low no further one changes a register: two release the reset,
#: one ends the store, one the line.
SETTLING_CLOCKS = 8


class SimulatedEngine(SteppingEngine):
    """An :class:`~cubestack.emulator.rtl.engine.RtlEngine` at some ten thousand clocks a second.

    With ``skipping``, of a longer low part of HSYNC only ``SETTLING_CLOCKS`` clocks are made.
    """

    def __init__(
        self, top: CubeStarTop, sram_timing: SramTiming | None = None, *, skipping: bool = True
    ) -> None:
        """Elaborate ``top``."""
        super().__init__(1 << len(top.SRAM_A), skipping=skipping)
        self._top = top
        self._sram = Sram(self.sram, sram_timing)
        self._edge = 0
        self._low_clocks = 0  # clocks in a row with HSYNC low
        contexts: list[Any] = []

        async def lend_context(context: Any) -> None:
            contexts.append(context)

        simulator = Simulator(top)
        simulator.add_testbench(lend_context)
        simulator.advance()
        # All time is ours, the simulator only has to settle: its context does that in every set().
        self._context = contexts[0]

    def close(self) -> None:
        """Nothing to release."""

    @property
    def violation_log(self) -> ViolationLog:
        """What the SRAM model recorded."""
        return self._sram.violations

    def _get(self, name: str) -> int:
        return int(self._context.get(getattr(self._top, name)))

    def _set(self, name: str, value: int) -> None:
        self._drive(self.now_ps, name, value)

    def _drive(self, time_ps: int, name: str, value: int) -> None:
        if name == "DCLK" and value and not self._get("DCLK"):
            self._sram.sample(time_ps)
        self._context.set(getattr(self._top, name), value)
        pins = SramPins(
            self._get("SRAM_A"),
            self._get("SRAM_CE_N"),
            self._get("SRAM_OE_N"),
            self._get("SRAM_WE_N"),
            self._get("SRAM_D_O") if self._get("SRAM_D_OE") else None,
        )
        self._sram.drive(time_ps, pins)
        self._context.set(self._top.SRAM_D_I, self._sram.bus)

    def _load(self, loaded: LoadedSegment | None, edge: int) -> None:
        self._edge = edge
        self._low_clocks = 0
        if loaded is None:
            self._put_lines(0, 0)
            self._context.set(self._top.VSYNC, 0)
            return
        self._context.set(self._top.VSYNC, loaded.segment.vsync)
        self._put_lines(*loaded.sample(edge // 2))

    def _put_lines(self, hsync: int, pixel: int) -> None:
        # Registers' inputs only: nothing but the next rising edge can show them.
        self._context.set(self._top.HSYNC, hsync)
        self._context.set(self._top.PIXDATA, pixel)

    def _use_pixels(self, pixels: NDArray[np.uint8]) -> None:
        if self._loaded is not None:
            self._put_lines(*self._loaded.sample(self._edge // 2))

    def _burst(self, until_ps: int, stop_level: int | None) -> tuple[int, Outcome]:
        loaded = self._loaded
        assert loaded is not None
        time_ps = self.now_ps
        while self._edge < loaded.edges:
            if loaded.time_of(self._edge) > until_ps:
                return until_ps, Outcome.TIME_REACHED
            time_ps = loaded.time_of(self._edge)
            sample, falling = divmod(self._edge, 2)
            self._edge += 1
            if falling:
                if self._edge < loaded.edges:
                    self._put_lines(*loaded.sample(sample + 1))
                self._drive(time_ps, "PIXCLK", 0)
                continue
            self._drive(time_ps, "PIXCLK", 1)
            self._low_clocks = 0 if self._get("HSYNC") else self._low_clocks + 1
            if self._skipping and self._low_clocks >= SETTLING_CLOCKS:
                self._skip_low_samples(loaded, sample, until_ps)
            if self._get("ACK") == stop_level:
                return time_ps, Outcome.ACK_REACHED
        return time_ps, Outcome.SEGMENT_OVER

    def _skip_low_samples(self, loaded: LoadedSegment, sample: int, until_ps: int) -> None:
        """Go on with the falling edge of the last sample of this low part that is in reach."""
        in_reach = (loaded.first_edge(until_ps + 1) - 1) // 2
        last = min(loaded.low_until(sample) - 1, in_reach)
        self._edge = max(self._edge, 2 * last + 1)

    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        for i in range(len(out)):
            self._drive(self.now_ps + int(fraction + i * period), "DCLK", 1)
            out[i] = self._get("DATA")
            fall_ps = self.now_ps + int(fraction + (i + Fraction(1, 2)) * period)
            self._drive(fall_ps, "DCLK", 0)
