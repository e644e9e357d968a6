"""Base class of the engines: FPGAs and their SRAMs in virtual time.

The compiled engine is fast. The one on the Amaranth simulator is the reference, and the fallback
without a C++ compiler. This module has what both share: segments of the cameras' streams, idle time
and virtual time. A camera is idle while its pixel clock changes nothing, which the wiring decides;
the engine then skips its clocks (visible only in the data output to a memory while not driven).
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


class UnsettledError(ValueError):
    """The design oscillates at one instant."""


class PinEvent(NamedTuple):
    """A change of an input pin."""

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
    """A camera port of the FPGA, and its current source."""

    number: int
    pins: CameraPins
    source: PixelSource | None = None
    loaded: LoadedSegment | None = None
    entered: tuple[int, int] = (0, 0)  # start of the loaded segment, and the first edge run
    skipped: bool = False  # the pixel clock is behind the time


class RtlEngine(ABC):
    """A wiring's design, cycle for cycle, with its SRAMs; implements ``FpgaPort``.

    Only ``run``, ``apply``, ``strobe_read`` and ``access`` advance time. At one instant, edges of
    the first camera's pixel clock come first, then those of the next one's, then the caller's
    changes of the microcontroller's pins.

    Attributes:
        wiring: names of all pins, cameras and memories.
        now_ps: virtual time.
        memories: bytes of each memory by its name, live views, shape (2 ** width of its address,).
        sram: bytes of the first memory.
        flip_changed: whether the latest ``flip`` changed anything; in reset it does not.
    """

    def __init__(self, wiring: Wiring, *, skipping: bool) -> None:
        """Start at time 0 without cameras; inputs have their initial levels, memories are 0."""
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
        self._idle = False  # no camera runs until a pin changes
        self._next_strobe = 0, Fraction(0), 0  # time, period, and parts of a ps in its denominator
        self._upsets: list[tuple[int, str, int]] = []  # time, register, bit; pending
        self.flip_changed = False

    @abstractmethod
    def _set(self, name: str, value: int) -> None: ...

    @abstractmethod
    def _get(self, name: str) -> int: ...

    @abstractmethod
    def _power(self, memory: int, on: bool) -> None: ...

    @abstractmethod
    def _load(self, camera: int, loaded: LoadedSegment | None, edge: int) -> None:
        """Continue with ``edge`` of a segment, and put its sample on the lines."""

    @abstractmethod
    def _use_pixels(self, camera: int, pixels: NDArray[np.uint8]) -> None: ...

    @abstractmethod
    def _burst(self, until_ps: int, cameras: Sequence[int]) -> tuple[int, BurstEnd, int]:
        """Run the edges of the loaded segments up to ``until_ps``.

        Edges are ordered by time, then by ``cameras``. Returns the time reached, the reason, and
        the camera whose segment is over.
        """

    @abstractmethod
    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        """Fill ``out`` by data clocks from ``now_ps + fraction`` on, while no other clock runs."""

    @abstractmethod
    def close(self) -> None:
        """Release resources; the engine can not be used afterwards."""

    @property
    def registers(self) -> dict[str, int]:
        """Width of every register by its path in the design; empty in the simulated engine."""
        return {}

    @property
    def stride_clocks(self) -> int:
        """Number of clocks that ran within strides; see ``hdl.blocks.pinned``."""
        return 0

    def use_strides(self, on: bool) -> None:
        """Allow or forbid strides from ``now_ps`` on, in an engine that supports them."""
        del on  # this engine has none

    def state(self) -> bytes:
        """Levels of all registers, for comparison; empty in the simulated engine."""
        return b""

    def _flip(self, register: str, bit: int) -> None:
        raise AssertionError("this engine has no access to registers")

    @property
    def running(self) -> int:
        return 0 if self._idle else sum(1 << camera.number for camera in self._running())

    @property
    def driver(self) -> Driver | None:
        return None

    def attend(self, reached_ps: int, end: int, camera: int, until_ps: int) -> int:
        self._idle = False
        self.now_ps = max(self.now_ps, reached_ps)
        if _BURST_ENDS[end] is BurstEnd.SEGMENT_OVER:
            self._follow_segment(self._cameras[camera])
        self.run(until_ps)
        return self.running

    @property
    def violations(self) -> list[Violation]:
        """The first violations of each rule; see :mod:`cubestack.emulator.rtl.sram`."""
        return self._log.kept

    @property
    def violation_counts(self) -> Counter[ViolationKind]:
        return self._log.counts

    def attach(self, source: PixelSource | None, camera: str | None = None) -> None:
        """Connect a camera at ``now_ps``, by default the first one.

        None disconnects it: clock, syncs and data go low.
        """
        self._idle = False
        self._named(camera).source = source
        self.stream_changed(camera)

    def stream_changed(self, camera: str | None = None) -> None:
        """Call when a source changes what it sends from ``now_ps`` on: it is queried again."""
        self._idle = False
        self._follow_source(self._named(camera), self.now_ps)

    def power_memory(self, name: str, on: bool) -> None:
        """Switch a memory's supply at ``now_ps``; initially all memories are on.

        Without supply it ignores writes, returns 0 for reads and reports no violations. Its bytes
        stay in ``memories``; the caller models their decay.
        """
        if name not in self.memories:
            raise ValueError(f"unknown memory {name}; memories: {', '.join(self.memories)}")
        self.run(self.now_ps)
        self._power(list(self.memories).index(name), on)

    def flip(self, register: str, bit: int, at_ps: int | None = None) -> None:
        """Invert a bit of a register at ``at_ps`` (default now), as a particle does.

        The time may be between clock edges or on one. A register in reset keeps its reset value.
        Raises ValueError for an unknown bit, a time in the past, and in the simulated engine.
        """
        if not self.registers:
            raise ValueError("only the compiled engine can flip bits of the FPGA's registers")
        if bit not in range(self.registers.get(register, 0)):
            known = ", ".join(f"{name} ({bits})" for name, bits in self.registers.items())
            raise ValueError(f"no register bit {register}[{bit}]; registers (bits): {known}")
        if at_ps is not None and at_ps < self.now_ps:
            raise ValueError(f"an upset at {at_ps} ps is in the past; the time is {self.now_ps} ps")
        self._upsets.append((self.now_ps if at_ps is None else at_ps, register, bit))
        self._upsets.sort()
        self.run(self.now_ps)

    def _upset(self, register: str, bit: int) -> None:
        for camera in self._cameras:
            self._catch_up(camera)
        self._idle = False
        before = self.state(), dict(self.violation_counts)
        self._flip(register, bit)
        self.flip_changed = (self.state(), dict(self.violation_counts)) != before

    def set_pin(self, name: str, value: int) -> None:
        if name not in self.wiring.mcu_pins:
            names = ", ".join(self.wiring.mcu_pins)
            raise ValueError(f"the microcontroller does not drive {name}, only {names}")
        if value >> self.wiring.widths[name]:
            raise ValueError(f"{name} has {self.wiring.widths[name]} bits, too few for {value}")
        self.run(self.now_ps)
        for camera in self._cameras:
            self._catch_up(camera)
        self._idle = False
        self._set(name, value)

    def get_pin(self, name: str) -> int:
        if name in self._camera_of:
            self._catch_up(self._camera_of[name])
        elif name not in self.wiring.widths:
            raise ValueError(f"the FPGA has no pin {name!r}")
        return self._get(name)

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        while self._upsets and self._upsets[0][0] <= until_ps:
            time_ps, register, bit = self._upsets[0]
            if self._run(max(time_ps, self.now_ps), stop_on) < time_ps or (
                stop_on is not None and self._get(stop_on[0]) == stop_on[1]
            ):
                return self.now_ps
            del self._upsets[0]
            self._upset(register, bit)
        return self._run(until_ps, stop_on)

    def _run(self, until_ps: int, stop_on: tuple[str, int] | None) -> int:
        if self._idle and stop_on is None and until_ps >= self.now_ps:
            self.now_ps = until_ps
            return until_ps
        if until_ps < self.now_ps:
            raise ValueError(f"can not run to {until_ps} ps: the time is already {self.now_ps} ps")
        if stop_on is not None:
            if stop_on[0] not in self.wiring.acknowledges:
                names = " or ".join(self.wiring.acknowledges)
                raise ValueError(f"can not stop on {stop_on[0]}, only on {names}")
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
            # An acknowledge may begin idle time, so it always ends the burst.
            self.now_ps, end, number = self._burst(until_ps, [c.number for c in running])
            if end is BurstEnd.SEGMENT_OVER:
                self._follow_segment(self._cameras[number])
            elif end is BurstEnd.TIME_REACHED or (
                stop_on is not None and self._get(stop_on[0]) == stop_on[1]
            ):
                return self.now_ps

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        if period < 2:
            raise ValueError(f"a data clock needs a period of at least 2 ps, not {period}")
        self.run(self.now_ps)
        start, part = self.now_ps, 0
        whole, parts = period.numerator, period.denominator  # the period is whole / parts ps
        if self._next_strobe[:2] == (start, period):
            part = self._next_strobe[2]
        # The largest n for which cycle n, which ends at (part + n * whole) // parts, is in reach.
        reach = -((part - (until_ps - start + 1) * parts) // whole) - 1
        cycles = max(0, min(len(out), reach))
        upset = self._upsets and (self._upsets[0][0] - start) * parts <= cycles * whole
        if upset or (not self._idle and self._running()):
            self._strobe_step_by_step(out[:cycles], period, Fraction(part, parts))
        else:
            self._strobe(out[:cycles], period, Fraction(part, parts))
        taken, part = divmod(part + cycles * whole, parts)
        self.run(start + taken)
        self._next_strobe = (self.now_ps, period, part)
        return cycles

    def access(self, transactions: Transactions, until_ps: int) -> int:
        bus = self.wiring.bus
        if bus is None:
            raise ValueError(f"{type(self.wiring.component).__name__} has no external bus")
        if not 0 <= transactions.select < len(bus.selects):
            selects = " and ".join(bus.selects)
            raise ValueError(f"no chip select has number {transactions.select}; they are {selects}")
        self.run(self.now_ps)
        self._idle = False
        start, period = self.now_ps, transactions.period
        # The largest n for which transaction n, which ends at floor(n * period), is in reach.
        fitting = max(0, ceil((until_ps - start + 1) / period) - 1)
        access = RtlEngine._access if self._upsets else type(self)._access
        done = access(self, transactions.first(min(fitting, len(transactions))))
        self.run(start + int(done * period))
        return done

    def _access(self, transactions: Transactions) -> int:
        """Run transactions pin by pin, until a byte read is above the limit; their number."""
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
        """Drive any input pins, for comparisons of engines.

        ``events`` are ordered by time, from ``now_ps`` on, without two clock edges at one instant.
        A camera's pins can be driven only while no source is attached to it. Returns the settled
        levels of the wiring's ``output_pins`` after each event, shape (events, pins).
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

    def replay(
        self,
        times_ps: NDArray[np.int64],
        pins: Sequence[str],
        numbers: NDArray[np.int32],
        levels: NDArray[np.uint32],
        watched: Sequence[str],
    ) -> NDArray[np.uint32]:
        """``apply`` of many events as arrays: event n sets ``pins[numbers[n]]``.

        No camera may be attached. Returns the settled levels of the pins ``watched`` after each
        event, shape (events, watched).
        """
        outputs = np.zeros((len(times_ps), len(watched)), np.uint32)
        events = zip(times_ps.tolist(), numbers.tolist(), levels.tolist(), strict=True)
        for row, (time_ps, number, level) in enumerate(events):
            self.apply([PinEvent(time_ps, pins[number], level)])
            outputs[row] = [self._get(name) for name in watched]
        return outputs

    def _named(self, name: str | None) -> _Camera:
        for camera in self._cameras:
            if name in (None, camera.pins.name):
                return camera
        names = ", ".join(camera.pins.name for camera in self._cameras)
        raise ValueError(f"unknown camera {name}; cameras: {names}")

    def _running(self) -> list[_Camera]:
        """The cameras whose clocks must run; renders pixels that may be stored.

        None of them has skipped clocks: only ``set_pin`` adds a camera to these.
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
        """Set the pixel clock to the level that it would have without skipped clocks."""
        if camera.skipped:
            camera.skipped = self._idle = False
            entered = camera.entered
            # The skipped edges are those up to and including now.
            self._follow_source(camera, self.now_ps + 1)
            if camera.entered != entered and camera.entered[1] % 2 == 1:
                self._set(camera.pins.clock, 1)

    def _follow_source(self, camera: _Camera, first_ps: int) -> None:
        """Continue with the source's first edge at ``first_ps`` or later."""
        source, clock = camera.source, camera.pins.clock
        segment = None if source is None else source.segment_at(self.now_ps)
        if source is None or segment is None:
            self._enter_segment(camera, None, 0)
            return
        loaded = LoadedSegment.of(source, segment)
        edge = loaded.first_edge(first_ps)
        # A rising edge at this instant has run already if the clock is high; repeated, it does
        # nothing.
        at_rise = edge < loaded.edges and loaded.time_of(edge) == self.now_ps
        if edge % 2 == 0 and self._get(clock) and not at_rise:
            self._set(clock, 0)
        if edge == loaded.edges:
            camera.loaded = loaded
            self._follow_segment(camera)
        else:
            self._enter_segment(camera, loaded, edge)

    def _follow_segment(self, camera: _Camera) -> None:
        """Continue after the loaded segment, all edges of which have run."""
        source, over = camera.source, camera.loaded
        assert source is not None
        assert over is not None
        segment = source.segment_at(over.end_ps)
        if segment is not None and segment.start_ps == over.segment.start_ps:
            # Both starts are rounded down, so the gap between them may be 1 ps longer.
            segment = source.segment_at(over.end_ps + 1)
        if segment is None:
            self._enter_segment(camera, None, 0)
            return
        if segment.start_ps < over.end_ps:
            raise ValueError(
                f"the source's next segment starts at {segment.start_ps} ps, "
                f"before the last one's end at {over.end_ps} ps"
            )
        self._enter_segment(camera, LoadedSegment.of(source, segment), 0)

    def _enter_segment(self, camera: _Camera, loaded: LoadedSegment | None, edge: int) -> None:
        camera.loaded = loaded
        camera.entered = (loaded.segment.start_ps if loaded else self.now_ps, edge)
        if loaded is None and self._get(camera.pins.clock):
            self._set(camera.pins.clock, 0)
        self._load(camera.number, loaded, edge)

    def _strobe_step_by_step(
        self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction
    ) -> None:
        """``_strobe`` while pixel clocks run, or with an upset in the middle."""
        start, clock = self.now_ps, self.wiring.data_clock
        for i in range(len(out)):
            self.run(start + int(fraction + i * period))
            self._set(clock, 1)
            self.run(start + int(fraction + (i + Fraction(1, 2)) * period))
            out[i] = self._get(self.wiring.data)
            self._set(clock, 0)
