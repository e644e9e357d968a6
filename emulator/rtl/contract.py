"""What an engine is: FPGAs and their SRAMs, run in virtual time by cameras and microcontroller.

The compiled engine is quick; the one on the Amaranth simulator is the reference, and the fallback
where there is no C++ compiler. What both share is here: segments of the cameras' streams, idle
time, and virtual time. A camera whose pixel clock changes nothing is idle; the wiring tells when
that is. Time may pass without making its clocks (the data output to a memory, not driven, apart).
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from fractions import Fraction
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.pixel_clock import LoadedSegment, PixelSource
from cubestack.emulator.rtl.sram import Violation, ViolationKind, ViolationLog
from cubestack.emulator.rtl.wiring import CameraPins, Wiring
from cubestack.emulator.sim.fpga_port import STEPS, TAKE, Driver, Transactions


class PinEvent(NamedTuple):
    """One input pin takes a level."""

    time_ps: int
    pin: str
    level: int


class BurstEnd(Enum):
    """Why a burst of pixel clock edges ended."""

    TIME_REACHED = auto()
    ACKNOWLEDGE_CHANGED = auto()
    SEGMENT_OVER = auto()


_BURST_ENDS = tuple(BurstEnd)  # declared in the driver's order


@dataclass
class _Camera:
    """A camera's place at the FPGA, and what is connected there."""

    number: int
    pins: CameraPins
    source: PixelSource | None = None
    loaded: LoadedSegment | None = None
    entered: tuple[int, int] = (0, 0)  # start of the loaded segment, and its first edge made
    skipped: bool = False  # the pixel clock stands at an earlier time


class RtlEngine(ABC):
    """A wiring's design, cycle for cycle, and its SRAMs: an ``FpgaPort`` and more.

    Time only moves in ``run``, ``apply``, ``strobe_read`` and ``access``. At one instant, edges of
    the first camera's pixel clock come first, then those of the next one's, then what the caller
    does to the microcontroller's pins.

    Attributes:
        wiring: names of all pins, cameras and memories.
        now_ps: virtual time.
        memories: each memory's bytes by its name, live views, shape (2 ** width of its address,).
        sram: those of the first one.
        flip_changed: whether the latest ``flip`` changed anything; in reset it does not.
    """

    def __init__(self, wiring: Wiring, *, skipping: bool) -> None:
        """Start at time 0 with no camera, all inputs as the design has them, memories zero."""
        self.wiring = wiring
        self.now_ps = 0
        self.memories: dict[str, NDArray[np.uint8]] = {
            memory.name: np.zeros(1 << wiring.widths[memory["A"]], np.uint8)
            for memory in wiring.memories
        }
        self.sram = self.memories[wiring.memories[0].name]
        self._skipping = skipping
        self._log = ViolationLog()
        self._cameras = [_Camera(number, pins) for number, pins in enumerate(wiring.cameras)]
        self._camera_of = {pin: camera for camera in self._cameras for pin in camera.pins.pins}
        self._idle = False  # no camera runs, and none will before something is done to the pins
        self._next_strobe = 0, Fraction(0), Fraction(0)  # time, period, fraction
        self._later: list[tuple[int, str, int]] = []  # time, register and bit of upsets to come
        self.flip_changed = False

    @abstractmethod
    def _set(self, name: str, value: int) -> None:
        """Drive input ``name`` at ``now_ps`` and let everything settle."""

    @abstractmethod
    def _get(self, name: str) -> int:
        """Settled level of any pin."""

    @abstractmethod
    def _power(self, memory: int, on: bool) -> None:
        """Switch a memory's supply at ``now_ps``."""

    @abstractmethod
    def _load(self, camera: int, loaded: LoadedSegment | None, edge: int) -> None:
        """Continue with ``edge`` of a segment, whose sample now stands on the lines."""

    @abstractmethod
    def _use_pixels(self, camera: int, pixels: NDArray[np.uint8]) -> None:
        """The lines of the loaded segment have been rendered."""

    @abstractmethod
    def _burst(self, until_ps: int, cameras: Sequence[int]) -> tuple[int, BurstEnd, int]:
        """Make the edges of the loaded segments up to ``until_ps``.

        Edges are made in the order of time, then of ``cameras``. Returns the time reached, why,
        and the camera whose segment is over.
        """

    @abstractmethod
    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        """Fill ``out`` by data clocks from ``now_ps + fraction`` on, with no other clock."""

    @abstractmethod
    def close(self) -> None:
        """Release what the engine holds; it can not be used afterwards."""

    @property
    def registers(self) -> dict[str, int]:
        """Bits of every register by its path in the design; empty in the simulated engine."""
        return {}

    @property
    def clocks_at_once(self) -> int:
        """Clocks that were not made one by one, but as strides; see `hdl.blocks.stride`."""
        return 0

    def use_strides(self, on: bool) -> None:
        """Whether strides may be made at once, where the engine can, from ``now_ps`` on."""
        del on  # it makes none

    def state(self) -> bytes:
        """Levels of all registers, to be compared; of the simulated engine nothing."""
        return b""

    def _flip(self, register: str, bit: int) -> None:
        """Turn a bit of a register over at ``now_ps`` and let everything settle."""
        raise AssertionError("there is no register to turn over")

    @property
    def running(self) -> int:
        """Cameras whose clocks are made now; see ``FpgaPort``."""
        return 0 if self._idle else sum(1 << camera.number for camera in self._running())

    @property
    def driver(self) -> Driver | None:
        """The compiled driver; see ``FpgaPort``."""
        return None

    def attend(self, reached_ps: int, end: int, camera: int, until_ps: int) -> int:
        """Take over a burst that ended; see ``FpgaPort``."""
        self._idle = False
        self.now_ps = max(self.now_ps, reached_ps)
        if _BURST_ENDS[end] is BurstEnd.SEGMENT_OVER:
            self._follow_segment(self._cameras[camera])
        self.run(until_ps)
        return self.running

    @property
    def violations(self) -> list[Violation]:
        """The first broken rules of each kind; see :mod:`cubestack.emulator.rtl.sram`."""
        return self._log.kept

    @property
    def violation_counts(self) -> Counter[ViolationKind]:
        """How often each rule was broken."""
        return self._log.counts

    def attach(self, source: PixelSource | None, camera: str | None = None) -> None:
        """Connect a camera at ``now_ps``, by default the first one.

        None disconnects it: clock, syncs and data go low.
        """
        self._idle = False
        self._named(camera).source = source
        self.stream_changed(camera)

    def stream_changed(self, camera: str | None = None) -> None:
        """Ask the source again: what it does from ``now_ps`` on is not what it said before."""
        self._idle = False
        self._follow_source(self._named(camera), self.now_ps)

    def power_memory(self, name: str, on: bool) -> None:
        """Switch a memory's supply at ``now_ps``; all memories begin with it.

        Without supply it ignores writes, answers reads with 0 and breaks no rules. Its bytes stay
        in ``memories``: what is left of them is the caller's to say.
        """
        if name not in self.memories:
            raise ValueError(f"the memories are {', '.join(self.memories)}, not {name}")
        self.run(self.now_ps)
        self._power(list(self.memories).index(name), on)

    def flip(self, register: str, bit: int, at_ps: int | None = None) -> None:
        """Turn over a bit of a register at ``at_ps``, by default now; ValueError for none.

        As a particle does: between two edges of any clock, or on one. A register that is in reset
        at once has its reset value again.
        """
        if not self.registers:
            raise ValueError("only the compiled engine can turn over the FPGA's registers")
        if bit not in range(self.registers.get(register, 0)):
            known = ", ".join(f"{name} ({bits})" for name, bits in self.registers.items())
            raise ValueError(f"no register bit {register}[{bit}]; registers (bits): {known}")
        if at_ps is not None and at_ps < self.now_ps:
            raise ValueError(f"an upset at {at_ps} ps is too late, it is {self.now_ps} ps")
        self._later.append((self.now_ps if at_ps is None else at_ps, register, bit))
        self._later.sort()
        self.run(self.now_ps)

    def _turn_over(self, register: str, bit: int) -> None:
        for camera in self._cameras:
            self._catch_up(camera)
        self._idle = False
        before = self.state(), dict(self.violation_counts)
        self._flip(register, bit)
        self.flip_changed = (self.state(), dict(self.violation_counts)) != before

    def set_pin(self, name: str, value: int) -> None:
        """Drive one of the microcontroller's pins; this and what follows as in ``FpgaPort``."""
        if name not in self.wiring.mcu_pins:
            names = ", ".join(self.wiring.mcu_pins)
            raise ValueError(f"the microcontroller drives {names}, not {name}")
        if value >> self.wiring.widths[name]:
            raise ValueError(f"{name} has {self.wiring.widths[name]} bits, too few for {value}")
        self.run(self.now_ps)
        for camera in self._cameras:
            self._catch_up(camera)
        self._idle = False
        self._set(name, value)

    def get_pin(self, name: str) -> int:
        """Settled level of any pin, the cameras' too."""
        if name in self._camera_of:
            self._catch_up(self._camera_of[name])
        elif name not in self.wiring.widths:
            raise ValueError(f"the FPGA has no pin {name!r}")
        return self._get(name)

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps`` or to ``stop_on``."""
        while self._later and self._later[0][0] <= until_ps:
            time_ps, register, bit = self._later[0]
            if self._run(max(time_ps, self.now_ps), stop_on) < time_ps or (
                stop_on is not None and self._get(stop_on[0]) == stop_on[1]
            ):
                return self.now_ps
            del self._later[0]
            self._turn_over(register, bit)
        return self._run(until_ps, stop_on)

    def _run(self, until_ps: int, stop_on: tuple[str, int] | None) -> int:
        """Do as ``run`` does, without upsets."""
        if self._idle and stop_on is None and until_ps >= self.now_ps:
            self.now_ps = until_ps
            return until_ps
        if until_ps < self.now_ps:
            raise ValueError(f"can not run back from {self.now_ps} ps to {until_ps} ps")
        if stop_on is not None:
            if stop_on[0] not in self.wiring.acknowledges:
                names = " or ".join(self.wiring.acknowledges)
                raise ValueError(f"can stop on {names} only, not on {stop_on[0]}")
            if self._get(stop_on[0]) == stop_on[1]:
                return self.now_ps
        while True:
            running = self._running()
            for camera in self._cameras:
                if camera not in running:
                    camera.skipped = camera.loaded is not None
            if not running:
                self._idle = True
                self.now_ps = until_ps
                return self.now_ps
            # An acknowledge is where idle time begins, so it ends the burst in any case.
            self.now_ps, end, number = self._burst(until_ps, [c.number for c in running])
            if end is BurstEnd.SEGMENT_OVER:
                self._follow_segment(self._cameras[number])
            elif end is BurstEnd.TIME_REACHED or (
                stop_on is not None and self._get(stop_on[0]) == stop_on[1]
            ):
                return self.now_ps

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        """Run the transfer loop."""
        if period < 2:
            raise ValueError(f"a data clock needs a period of at least 2 ps, not {period}")
        self.run(self.now_ps)
        start, fraction = self.now_ps, Fraction(0)
        if self._next_strobe[:2] == (self.now_ps, period):
            fraction = self._next_strobe[2]
        # Cycle n ends at floor(fraction + n * period): the largest n that keeps it within reach.
        reach = ceil((until_ps - self.now_ps + 1 - fraction) / period) - 1
        cycles = max(0, min(len(out), reach))
        upset = self._later and self._later[0][0] <= start + cycles * period
        if self._running() or upset:
            self._strobe_step_by_step(out[:cycles], period, fraction)
        else:
            self._strobe(out[:cycles], period, fraction)
        whole, fraction = divmod(fraction + cycles * period, 1)
        self.run(start + whole)
        self._next_strobe = (self.now_ps, period, fraction)
        return cycles

    def access(self, transactions: Transactions, until_ps: int) -> int:
        """Make transactions on the external bus."""
        bus = self.wiring.bus
        if bus is None:
            raise ValueError(f"{type(self.wiring.component).__name__} has no external bus")
        if not 0 <= transactions.select < len(bus.selects):
            selects = " and ".join(bus.selects)
            raise ValueError(f"there is no chip select {transactions.select}, only {selects}")
        self.run(self.now_ps)
        self._idle = False
        start, period = self.now_ps, transactions.period
        # Transaction n ends at floor(n * period): the largest n that keeps it within reach.
        fitting = max(0, ceil((until_ps - start + 1) / period) - 1)
        access = RtlEngine._access if self._later else type(self)._access
        done = access(self, transactions.first(min(fitting, len(transactions))))
        self.run(start + int(done * period))
        return done

    def _access(self, transactions: Transactions) -> int:
        """Make transactions pin by pin, until a byte read is above the limit; how many."""
        bus, start = self.wiring.bus, self.now_ps
        assert bus is not None
        for event in range(STEPS * len(transactions)):
            index, step = divmod(event, STEPS)
            self.run(start + transactions.time_of(event))
            if step == TAKE and not transactions.write:
                driven = self._get(f"{bus.low}_OE")
                transactions.data[index] = self._get(f"{bus.low}_{'O' if driven else 'I'}")
            for pin, level in bus.levels(transactions, event):
                self._set(pin, level)
            last = step == STEPS - 1 and not transactions.write
            if last and transactions.data[index] > transactions.above:
                return index + 1
        return len(transactions)

    def apply(self, events: Sequence[PinEvent]) -> NDArray[np.int64]:
        """Drive any input pin at any time, for tests of one engine against another.

        Events are in the order of time, none before ``now_ps``, and no two clock edges at one
        instant. A camera's pins can be driven only while no source is attached to it. Returns the
        settled levels of the wiring's ``output_pins`` after each event, shape (events, pins).
        """
        pins = self.wiring.output_pins
        outputs = np.zeros((len(events), len(pins)), np.int64)
        for row, (time_ps, pin, level) in enumerate(events):
            self.run(time_ps)
            self._idle = False
            if pin in self._camera_of and self._camera_of[pin].source is None:
                self._set(pin, level)
            else:
                self.set_pin(pin, level)
            outputs[row] = [self._get(name) for name in pins]
        return outputs

    def _named(self, name: str | None) -> _Camera:
        for camera in self._cameras:
            if name in (None, camera.pins.name):
                return camera
        names = ", ".join(camera.pins.name for camera in self._cameras)
        raise ValueError(f"the cameras are {names}, not {name}")

    def _running(self) -> list[_Camera]:
        """The cameras whose clocks are to be made, their pixels rendered where they may be stored.

        None of them has skipped a clock: a camera becomes one of these by ``set_pin`` only.
        """
        storing, stored = self.wiring.storing(self._get), self.wiring.stored(self._get)
        running = []
        for camera in self._cameras:
            loaded, stores = camera.loaded, camera.pins.name in storing
            if loaded is None or (self._skipping and not stores):
                continue
            wanted = stores and camera.pins.name not in stored
            if wanted and loaded.segment.rows and loaded.pixels is None:
                self._use_pixels(camera.number, loaded.render())
            running.append(camera)
        return running

    def _catch_up(self, camera: _Camera) -> None:
        """Put the pixel clock where it would be, had no clock been skipped."""
        if camera.skipped:
            camera.skipped = self._idle = False
            entered = camera.entered
            # The edges up to now, now included, are those that were skipped.
            self._follow_source(camera, self.now_ps + 1)
            if camera.entered != entered and camera.entered[1] % 2 == 1:
                self._set(camera.pins.clock, 1)

    def _follow_source(self, camera: _Camera, first_ps: int) -> None:
        """Continue with the source's first edge at ``first_ps`` or later."""
        source, clock = camera.source, camera.pins.clock
        segment = None if source is None else source.segment_at(self.now_ps)
        if source is None or segment is None:
            self._go_to(camera, None, 0)
            return
        loaded = LoadedSegment.of(source, segment)
        edge = loaded.first_edge(first_ps)
        # A rising edge at this instant was made already if the clock is high; again it does
        # nothing.
        at_rise = edge < loaded.edges and loaded.time_of(edge) == self.now_ps
        if edge % 2 == 0 and self._get(clock) and not at_rise:
            self._set(clock, 0)
        if edge == loaded.edges:
            camera.loaded = loaded
            self._follow_segment(camera)
        else:
            self._go_to(camera, loaded, edge)

    def _follow_segment(self, camera: _Camera) -> None:
        """Continue with what comes after the loaded segment, whose edges are all made."""
        source, over = camera.source, camera.loaded
        assert source is not None
        assert over is not None
        segment = source.segment_at(over.end_ps)
        if segment is not None and segment.start_ps == over.segment.start_ps:
            # Where both starts are rounded down, the gap between them may be one longer.
            segment = source.segment_at(over.end_ps + 1)
        if segment is None:
            self._go_to(camera, None, 0)
            return
        if segment.start_ps < over.end_ps:
            raise ValueError(
                f"the source's next segment starts at {segment.start_ps} ps, "
                f"before the last one's end at {over.end_ps} ps"
            )
        self._go_to(camera, LoadedSegment.of(source, segment), 0)

    def _go_to(self, camera: _Camera, loaded: LoadedSegment | None, edge: int) -> None:
        camera.loaded = loaded
        camera.entered = (loaded.segment.start_ps if loaded else self.now_ps, edge)
        if loaded is None and self._get(camera.pins.clock):
            self._set(camera.pins.clock, 0)
        self._load(camera.number, loaded, edge)

    def _strobe_step_by_step(
        self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction
    ) -> None:
        """Do as ``_strobe`` does, with pixel clocks running, or an upset in the middle."""
        start, clock = self.now_ps, self.wiring.data_clock
        for i in range(len(out)):
            self.run(start + int(fraction + i * period))
            self._set(clock, 1)
            self.run(start + int(fraction + (i + Fraction(1, 2)) * period))
            out[i] = self._get(self.wiring.data)
            self._set(clock, 0)
