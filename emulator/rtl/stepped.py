"""Base class of the engines whose SRAMs are in Python and whose design is set pin by pin."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from sys import maxsize

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import BurstEnd, RtlEngine
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.emulator.rtl.sram import BETWEEN_FPGAS, Sram, SramPins, SramTiming, Violation
from cubestack.emulator.rtl.wiring import CameraPins, MemoryPins, Wiring


@dataclass
class Stream:
    """A camera's stream, and the position in it."""

    pins: CameraPins
    loaded: LoadedSegment | None = None
    edge: int = 0  # the next one
    low_clocks: int = 0  # clocks in a row with the line pin low

    @property
    def time_ps(self) -> int:
        assert self.loaded is not None
        return self.loaded.time_of(self.edge)


class SteppedEngine(RtlEngine):
    """The design is behind ``_get`` and ``_put``, which settles it.

    With ``skipping``, it runs at most the wiring's ``settling_clocks`` between two lines. Of
    a user's design it runs all, as that number is not proved.
    """

    def __init__(
        self, wiring: Wiring, sram_timing: SramTiming | None = None, *, skipping: bool = True
    ) -> None:
        super().__init__(wiring, skipping=skipping)
        timing = sram_timing or SramTiming()
        self._srams = [Sram(memory, timing, self._log, n) for n, memory in self.memories.items()]
        self._streams = [Stream(pins) for pins in wiring.cameras]
        self._settling_clocks = maxsize if wiring.foreign else wiring.settling_clocks
        self._contention = 0

    @abstractmethod
    def _put(self, name: str, value: int) -> None: ...

    def _set(self, name: str, value: int) -> None:
        self._drive(self.now_ps, name, value)

    def _drive(self, time_ps: int, name: str, value: int) -> None:
        if name == self.wiring.data_clock and value and not self._get(name):
            for sram in self._srams:
                sram.sample(time_ps)
        self._put(name, value)
        self._settle(time_ps)

    def _settle(self, time_ps: int) -> None:
        memories = list(zip(self._srams, self.wiring.memories, strict=True))
        for sram, memory in memories:
            sram.drive(time_ps, self._memory_pins(memory))
        for sram, memory in memories:
            self._put(memory["D_I"], sram.bus)
        if self.wiring.contention is not None:
            found, before = self._get(self.wiring.contention), self._contention
            if found & ~before:
                self._log.add(Violation("wire-contention", time_ps, 0, found, 0, BETWEEN_FPGAS))
            self._contention = found

    def _memory_pins(self, memory: MemoryPins) -> SramPins:
        a, ce_n, oe_n, we_n = (self._get(memory[pin]) for pin in ("A", "CE_N", "OE_N", "WE_N"))
        data = self._get(memory["D_O"]) if self._get(memory["D_OE"]) else None
        return SramPins(a, ce_n, oe_n, we_n, data)

    def _power(self, memory: int, on: bool) -> None:
        self._srams[memory].power(on)
        self._settle(self.now_ps)

    def _load(self, camera: int, loaded: LoadedSegment | None, edge: int) -> None:
        stream = self._streams[camera]
        stream.loaded, stream.edge, stream.low_clocks = loaded, edge, 0
        if stream.pins.frame is not None:
            self._put(stream.pins.frame, 0 if loaded is None else loaded.segment.vsync)
        self._put_sample(stream)

    def _put_sample(self, stream: Stream) -> None:
        loaded = stream.loaded
        line, pixel = (0, 0) if loaded is None else loaded.sample(stream.edge // 2)
        self._put(stream.pins.line, line)
        self._put(stream.pins.data, pixel)

    def _use_pixels(self, camera: int, pixels: NDArray[np.uint8]) -> None:
        self._put_sample(self._streams[camera])

    def _burst(self, until_ps: int, cameras: Sequence[int]) -> tuple[int, BurstEnd, int]:
        before = self._acknowledges()
        while True:
            camera = min(cameras, key=lambda number: self._streams[number].time_ps)
            stream = self._streams[camera]
            assert stream.loaded is not None
            time_ps = stream.time_ps
            if time_ps > until_ps:
                return until_ps, BurstEnd.TIME_REACHED, camera
            self._run_edge(stream, stream.loaded, time_ps, until_ps)
            changed = self._acknowledges() != before
            if changed or stream.edge == stream.loaded.edges:
                for number in cameras:
                    self._go_back(self._streams[number], time_ps, number > camera)
                end = BurstEnd.ACKNOWLEDGE_CHANGED if changed else BurstEnd.SEGMENT_OVER
                return time_ps, end, camera

    def _acknowledges(self) -> list[int]:
        return [self._get(name) for name in self.wiring.acknowledges]

    def _run_edge(self, stream: Stream, loaded: LoadedSegment, time_ps: int, until_ps: int) -> None:
        falling = stream.edge % 2
        stream.edge += 1
        if falling:
            self._drive(time_ps, stream.pins.clock, 0)
            # The camera's lines move after its clock.
            if stream.edge < loaded.edges:
                self._put_sample(stream)
                self._settle(time_ps)
            return
        self._drive(time_ps, stream.pins.clock, 1)
        stream.low_clocks = 0 if self._get(stream.pins.line) else stream.low_clocks + 1
        if self._skipping and stream.low_clocks >= self._settling_clocks:
            # Continue with the falling edge of the last sample of this low run that is in reach.
            in_reach = (loaded.first_edge(until_ps + 1) - 1) // 2
            last = min(loaded.low_until(stream.edge // 2) - 1, in_reach)
            stream.edge = max(stream.edge, 2 * last + 1)

    def _go_back(self, stream: Stream, now_ps: int, include_now: bool) -> None:
        """Undo the skipping beyond ``now_ps``, as the pins may change before those edges.

        With ``include_now``, an edge at ``now_ps`` itself has yet to run.
        """
        assert stream.loaded is not None
        edge = stream.loaded.first_edge(now_ps if include_now else now_ps + 1)
        if stream.edge > edge:
            stream.edge = edge
            self._drive(now_ps, stream.pins.clock, edge % 2)

    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        for number in range(len(out)):
            self._strobe_clock(out, number, period, fraction)

    def _strobe_clock(
        self, out: NDArray[np.uint8], number: int, period: Fraction, fraction: Fraction
    ) -> None:
        clock = self.wiring.data_clock
        self._drive(self.now_ps + int(fraction + number * period), clock, 1)
        out[number] = self._get(self.wiring.data)
        self._drive(self.now_ps + int(fraction + (number + Fraction(1, 2)) * period), clock, 0)
