"""What both engines share: segments of the camera's stream, idle time, and virtual time.

CubeStar's FPGA is idle when it is not storing, or has stored a frame: its pixel clock domain is
in reset, or waits for one. Pixel clocks then change nothing (SRAM_D_O, not driven, apart), so
time may pass without making them.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from enum import Enum, auto
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.engine import (
    CAMERA_PINS,
    MCU_PINS,
    OUTPUT_PINS,
    PinEvent,
    PixelSource,
)
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.emulator.sram import Violation, ViolationKind, ViolationLog

__all__ = ["Outcome", "SteppingEngine"]


class Outcome(Enum):
    """Why a burst of pixel clock edges ended."""

    TIME_REACHED = auto()
    ACK_REACHED = auto()
    SEGMENT_OVER = auto()


class SteppingEngine(ABC):
    """An :class:`~cubestack.emulator.rtl.engine.RtlEngine` on top of a design that can be stepped.

    Attributes:
        now_ps: virtual time.
        sram: the memory's bytes.
    """

    def __init__(self, sram_size: int, *, skipping: bool) -> None:
        """Start at time 0 with no camera, all inputs low and the memory zero."""
        self.now_ps = 0
        self.sram: NDArray[np.uint8] = np.zeros(sram_size, np.uint8)
        self._skipping = skipping
        self._source: PixelSource | None = None
        self._loaded: LoadedSegment | None = None
        self._entered = (0, 0)  # start of the loaded segment, and its edge that was made first
        self._clocks_skipped = False  # the pixel clock stands at an earlier time
        self._next_strobe: tuple[int, Fraction, Fraction] | None = None  # time, period, fraction

    @property
    @abstractmethod
    def violation_log(self) -> ViolationLog:
        """What the SRAM model recorded."""

    @abstractmethod
    def _set(self, name: str, value: int) -> None:
        """Drive input ``name`` at ``now_ps`` and let everything settle."""

    @abstractmethod
    def _get(self, name: str) -> int:
        """Settled level of any pin."""

    @abstractmethod
    def _load(self, loaded: LoadedSegment | None, edge: int) -> None:
        """Continue with ``edge`` of a segment, whose sample now stands on the lines."""

    @abstractmethod
    def _use_pixels(self, pixels: NDArray[np.uint8]) -> None:
        """The lines of the loaded segment have been rendered."""

    @abstractmethod
    def _burst(self, until_ps: int, stop_level: int | None) -> tuple[int, Outcome]:
        """Make the loaded segment's edges up to ``until_ps``; return the time reached and why."""

    @abstractmethod
    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        """Fill ``out`` by DCLK cycles from ``now_ps + fraction`` on, with no other clock."""

    @property
    def violations(self) -> list[Violation]:
        """The first broken rules of the SRAM."""
        return self.violation_log.kept

    @property
    def violation_counts(self) -> Counter[ViolationKind]:
        """How often each rule of the SRAM was broken."""
        return self.violation_log.counts

    def attach(self, source: PixelSource | None) -> None:
        """Connect a camera, or disconnect it."""
        self._source = source
        self.stream_changed()

    def stream_changed(self) -> None:
        """Ask the source again from ``now_ps`` on, an edge at this very instant included."""
        self._follow_source(self.now_ps)

    def set_pin(self, name: str, value: int) -> None:
        """Drive one of the microcontroller's pins."""
        if name not in MCU_PINS:
            raise ValueError(f"the microcontroller drives {', '.join(MCU_PINS)}, not {name}")
        self.run(self.now_ps)
        self._catch_up()
        self._set(name, value)

    def get_pin(self, name: str) -> int:
        """Settled level of any pin."""
        if name in CAMERA_PINS:
            self._catch_up()
        elif name not in MCU_PINS and name not in OUTPUT_PINS:
            raise ValueError(f"the FPGA has no pin {name!r}")
        return self._get(name)

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps`` or to ``stop_on``."""
        if until_ps < self.now_ps:
            raise ValueError(f"can not run back from {self.now_ps} ps to {until_ps} ps")
        stop_level = None
        if stop_on is not None:
            pin, stop_level = stop_on
            if pin != "ACK":
                raise ValueError(f"can stop on ACK only, not on {pin}")
            if self._get("ACK") == stop_level:
                return self.now_ps
        while True:
            if self._source is None or self._loaded is None or self._may_skip():
                self._clocks_skipped = self._loaded is not None
                self.now_ps = until_ps
                return self.now_ps
            if self._loaded.segment.rows and self._loaded.pixels is None and not self._idle():
                self._use_pixels(self._loaded.render())
            # A frame stored is where idle time begins, so it ends the burst in any case.
            self.now_ps, outcome = self._burst(until_ps, 1 if self._skipping else stop_level)
            if outcome is Outcome.SEGMENT_OVER:
                self._follow_segment(self._source, self._loaded)
            elif outcome is Outcome.TIME_REACHED or self._get("ACK") == stop_level:
                return self.now_ps

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        """Run the transfer loop."""
        if period < 2:
            raise ValueError(f"a data clock needs a period of at least 2 ps, not {period}")
        self.run(self.now_ps)
        start, fraction = self.now_ps, Fraction(0)
        if self._next_strobe is not None and self._next_strobe[:2] == (self.now_ps, period):
            fraction = self._next_strobe[2]
        # Cycle n ends at floor(fraction + n * period): the largest n that keeps it within reach.
        reach = (until_ps - self.now_ps + 1 - fraction) / period
        cycles = max(0, min(len(out), -(-reach.numerator // reach.denominator) - 1))
        if self._loaded is None or self._may_skip():
            self._strobe(out[:cycles], period, fraction)
        else:
            self._strobe_beside_pixels(out[:cycles], period, fraction)
        whole, fraction = divmod(fraction + cycles * period, 1)
        self.run(start + whole)
        self._next_strobe = (self.now_ps, period, fraction)
        return cycles

    def apply(self, events: Sequence[PinEvent]) -> NDArray[np.int64]:
        """Drive input pins one event after the other; returns the outputs after each."""
        outputs = np.zeros((len(events), len(OUTPUT_PINS)), np.int64)
        for row, (time_ps, pin, level) in enumerate(events):
            self.run(time_ps)
            if pin in CAMERA_PINS and self._source is None:
                self._set(pin, level)
            else:
                self.set_pin(pin, level)
            outputs[row] = [self._get(name) for name in OUTPUT_PINS]
        return outputs

    def _may_skip(self) -> bool:
        return self._skipping and self._idle()

    def _idle(self) -> bool:
        storing = self._get("ENABLE") and not self._get("RNW")
        return not storing or bool(self._get("ACK"))

    def _catch_up(self) -> None:
        """Put the pixel clock where it would be, had no clock been skipped."""
        if self._clocks_skipped:
            self._clocks_skipped = False
            entered = self._entered
            # The edges up to now, now included, are those that were skipped.
            self._follow_source(self.now_ps + 1)
            if self._entered != entered and self._entered[1] % 2 == 1:
                self._set("PIXCLK", 1)

    def _follow_source(self, first_ps: int) -> None:
        """Continue with the source's first edge at ``first_ps`` or later."""
        segment = None if self._source is None else self._source.segment_at(self.now_ps)
        if self._source is None or segment is None:
            self._go_to(None, 0)
            return
        loaded = LoadedSegment.of(self._source, segment)
        edge = loaded.first_edge(first_ps)
        # A rising edge at this instant was made already if PIXCLK is high; again it does nothing.
        at_rise = edge < loaded.edges and loaded.time_of(edge) == self.now_ps
        if edge % 2 == 0 and self._get("PIXCLK") and not at_rise:
            self._set("PIXCLK", 0)
        if edge == loaded.edges:
            self._follow_segment(self._source, loaded)
        else:
            self._go_to(loaded, edge)

    def _follow_segment(self, source: PixelSource, over: LoadedSegment) -> None:
        """Continue with what comes after a segment whose edges are all made."""
        segment = source.segment_at(over.end_ps)
        if segment is not None and segment.start_ps == over.segment.start_ps:
            # Where both starts are rounded down, the gap between them may be one longer.
            segment = source.segment_at(over.end_ps + 1)
        if segment is None:
            self._go_to(None, 0)
            return
        if segment.start_ps < over.end_ps:
            raise ValueError(
                f"the source's next segment starts at {segment.start_ps} ps, "
                f"before the last one's end at {over.end_ps} ps"
            )
        self._go_to(LoadedSegment.of(source, segment), 0)

    def _go_to(self, loaded: LoadedSegment | None, edge: int) -> None:
        self._loaded = loaded
        self._entered = (loaded.segment.start_ps if loaded else self.now_ps, edge)
        if loaded is None and self._get("PIXCLK"):
            self._set("PIXCLK", 0)
        self._load(loaded, edge)

    def _strobe_beside_pixels(
        self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction
    ) -> None:
        """Do as ``_strobe`` does, with the pixel clock running."""
        start = self.now_ps
        for i in range(len(out)):
            self.run(start + int(fraction + i * period))
            self._set("DCLK", 1)
            self.run(start + int(fraction + (i + Fraction(1, 2)) * period))
            out[i] = self._get("DATA")
            self._set("DCLK", 0)
