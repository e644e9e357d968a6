"""Replays captured inputs into the emulated FPGA, and finds which output bits follow from them.

What the capture does not contain is tried with several values; what then changes is not compared.

- Registers at the start of the capture: random ones, until they agree with those after power-up.
  Before that, nothing is compared.
- Bytes of the memories that are read before they are written, if the data bus was not captured:
  inverted, and random ones.
- Inputs that were not captured: inverted.

A dependence that shows in none of these runs is missed.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.capture.capture import CaptureError
from cubestack.emulator.rtl.capture.pins import Signal
from cubestack.emulator.rtl.contract import PinEvent, RtlEngine
from cubestack.emulator.rtl.sram import ViolationKind, no_log
from cubestack.emulator.rtl.wiring import MemoryPins, Wiring

Levels = NDArray[np.int64]

_MEMORY_SEEDS = (1, 2)
"""Of the random contents of memories, beside the inverted one."""

_STATE_SEEDS = range(16)
"""Of the random registers. Each is flipped several times, as others may hold it in reset."""

_ROUNDS = 3

_PARTS = 200
"""Parts of the capture after which the registers of two runs are compared."""

_PASSES = 4
"""Replays in which bytes that were read are learned, at most."""


@dataclass(frozen=True)
class Emulated:
    """The emulated FPGA with the captured inputs.

    Attributes:
        times: of the inputs' changes in ps, increasing, shape (n,).
        levels: level of every port from each time on; of a memory's D_I, the level of its bus.
        known: bits of every output and bus that follow from the capture.
        held: level of each input that was not captured, or of the lines of it that were not.
        depends: bits of the outputs that depend on such an input, by input and output.
        since_ps: time from which on the registers follow from the capture.
        violations: number of broken rules of the memories and wires.
    """

    times: Levels
    levels: Mapping[str, Levels]
    known: Mapping[str, Levels]
    held: Mapping[str, int]
    depends: Mapping[str, Mapping[str, int]]
    since_ps: int
    violations: Counter[ViolationKind]


Memories = Mapping[str, NDArray[np.uint8]]


class Replay:
    """Captured inputs of a wiring's design; ``run`` drives an engine with them."""

    def __init__(
        self,
        wiring: Wiring,
        captured: Mapping[str, Signal],
        held: Mapping[str, int],
        make: Callable[[], RtlEngine],
        *,
        powered_up: bool = False,
    ) -> None:
        """Prepare; ``make`` creates an engine, ``held`` has levels of inputs by port.

        ``powered_up``: the registers are those after power-up when the capture begins.

        Raises CaptureError if no input was captured, or the data clock is missing.
        """
        self._wiring, self._captured, self._make = wiring, captured, make
        self._powered_up = powered_up
        self._first = 0  # instant from which on the registers are known
        self._outputs = (*wiring.output_pins, *(memory["D_I"] for memory in wiring.memories))
        driven = (*wiring.camera_pins, *wiring.mcu_pins)
        inputs = {
            port.name: captured.get(port.name, captured.get(str(pin)))
            for pin in wiring.component.pins
            for port in pin.ports
            if port.name in driven
        }
        self._inputs = {port: signal for port, signal in inputs.items() if signal is not None}
        self.held = {
            port: held.get(port, wiring.initial[port]) & ~self._bits(port)
            for port in inputs
            if port in held or self._bits(port) != self._all(port)
        }
        self._given = set(held)
        if not self._inputs:
            raise CaptureError("no input of the FPGA was captured, so nothing can be replayed")
        clock = wiring.data_clock
        if wiring.data in captured and clock not in self._inputs and clock not in held:
            raise CaptureError(
                f"{clock} was not captured, and {wiring.data} needs it; --hold {clock}=0 if it"
                " did not move"
            )
        self._sort()

    def _all(self, port: str) -> int:
        return (1 << self._wiring.widths[port]) - 1

    def _bits(self, port: str) -> int:
        """The captured lines of an input."""
        return self._inputs[port].bits if port in self._inputs else 0

    def _sort(self) -> None:
        """The changes of all inputs; at one instant a camera's lines come before its clock."""
        wiring = self._wiring
        clocks = {camera.clock for camera in wiring.cameras}
        parts = []
        for number, (port, signal) in enumerate(self._inputs.items()):
            rank = 1 if port in clocks else 0 if port in wiring.camera_pins else 2
            # A line without a known level keeps the one before, at first its idle level.
            size, bits = len(signal.times), self._bits(port)
            latest = np.maximum.accumulate(np.where(signal.known == bits, np.arange(size), -1))
            levels = np.where(latest < 0, wiring.initial[port] & bits, signal.levels[latest])
            place = np.full(size, rank), np.full(size, number)
            parts.append((signal.times, *place, signal.order, levels))
        times, ranks, numbers, order, levels = map(np.concatenate, zip(*parts, strict=True))
        sequence = np.lexsort((order, ranks, times))
        self._times, self._numbers = times[sequence], numbers[sequence].astype(np.int32)
        self._levels = levels[sequence]
        # The last event of each instant.
        self._last = np.flatnonzero(np.diff(self._times, append=self._times[-1] + 1))

    def run(self) -> Emulated:
        with no_log():  # the result has their numbers
            return self._run()

    def _run(self) -> Emulated:
        wiring = self._wiring
        memories = {
            memory.name: np.zeros(1 << wiring.widths[memory["A"]], np.uint8)
            for memory in wiring.memories
        }
        self._first = 0 if self._powered_up else self._determined(memories)
        learned = {name: np.zeros(len(memory), bool) for name, memory in memories.items()}
        for _ in range(_PASSES):
            levels, violations = self._replay(memories, self.held)
            found = [
                self._learn(memory, levels, memories[memory.name], learned[memory.name])
                for memory in wiring.memories
            ]
            if not any(found):
                break
        self._require_pixel_clocks(levels)
        known = {name: np.full(len(self._last), self._all(name)) for name in self._outputs}
        for levels_known in known.values():
            levels_known[: self._first] = 0
        if any(reads(memory, levels).any() for memory in wiring.memories):
            for other in _other_memories(memories, learned):
                tried, _ = self._replay(other, self.held)
                for name in self._outputs:
                    known[name] &= ~(levels[name] ^ tried[name])
        depends: dict[str, Mapping[str, int]] = {}
        for port in self.held.keys() - self._given:
            inverted = self.held[port] ^ (self._all(port) & ~self._bits(port))
            tried, _ = self._replay(memories, {**self.held, port: inverted})
            bits = {}
            for name in self._outputs:
                changed = (levels[name] ^ tried[name]) & known[name]
                known[name] &= ~changed
                bits[name] = int(np.bitwise_or.reduce(changed))
            depends[port] = {name: changed for name, changed in bits.items() if changed}
        times = self._times[self._last]
        return Emulated(
            times, levels, known, self.held, depends, int(times[self._first]), violations
        )

    def _replay(
        self, memories: Memories, held: Mapping[str, int]
    ) -> tuple[dict[str, Levels], Counter[ViolationKind]]:
        """Levels of all ports after each instant, and what the memories complained about."""
        with self._engine(memories, held) as engine:
            begin = int(self._last[self._first])
            before = self._drive(engine, held, 0, begin)
            for name, memory in memories.items():  # writes before are not known either
                engine.memories[name][:] = memory
            after = self._drive(engine, held, begin, len(self._times))
            settled = np.concatenate([before, after])[self._last].astype(np.int64)
            return dict(zip(self._watched, settled.T, strict=True)), engine.violation_counts

    def _determined(self, memories: Memories) -> int:
        """The first instant at which the registers no longer depend on those at the start."""
        bounds = self._last[:: max(1, len(self._last) // _PARTS)] + 1
        bounds = np.unique([*bounds.tolist(), len(self._times)]).tolist()
        usual: list[bytes] = []
        with self._engine(memories, self.held) as engine:
            for begin, end in pairwise([0, *bounds]):
                self._drive(engine, self.held, begin, end)
                usual.append(engine.state())
        latest = 0
        for seed in _STATE_SEEDS:
            random = np.random.default_rng(seed)
            with self._engine(memories, self.held) as engine:
                self._drive(engine, self.held, 0, bounds[0])
                for _ in range(_ROUNDS):
                    for register, width in engine.registers.items():
                        for bit in np.flatnonzero(random.integers(0, 2, width)):
                            engine.flip(register, int(bit))
                part = 0
                while part < len(bounds) and (part < latest or engine.state() != usual[part]):
                    part += 1
                    if part < len(bounds):
                        self._drive(engine, self.held, bounds[part - 1], bounds[part])
                latest = max(latest, part)
            if latest == len(bounds):
                raise CaptureError(
                    "the capture never shows the FPGA in a state that does not depend on what was"
                    " before; begin it while the FPGA is idle, or use --from-power-up if it begins"
                    " at power-up"
                )
        return int(np.searchsorted(self._last, bounds[latest] - 1)) if latest else 0

    @contextmanager
    def _engine(self, memories: Memories, held: Mapping[str, int]) -> Iterator[RtlEngine]:
        engine = self._make()
        try:
            for name, memory in memories.items():
                engine.memories[name][:] = memory
            for port, level in held.items():
                if port not in self._inputs:
                    engine.apply([PinEvent(max(int(self._times[0]), 0), port, level)])
            yield engine
        finally:
            engine.close()

    def _drive(
        self, engine: RtlEngine, held: Mapping[str, int], begin: int, end: int
    ) -> NDArray[np.uint32]:
        """Replay the events from ``begin`` to before ``end``."""
        ports = list(self._inputs)
        fixed = np.array([held.get(port, 0) for port in ports], np.int64)
        part = slice(begin, end)
        times, numbers = self._times[part] - min(int(self._times[0]), 0), self._numbers[part]
        levels = (self._levels[part] | fixed[numbers]).astype(np.uint32)
        return engine.replay(times, ports, numbers, levels, self._watched)

    @cached_property
    def _watched(self) -> tuple[str, ...]:
        return tuple(self._wiring.widths)

    def _learn(
        self,
        memory: MemoryPins,
        levels: Mapping[str, Levels],
        content: NDArray[np.uint8],
        learned: NDArray[np.bool_],
    ) -> bool:
        """Put bytes that the capture reads before it writes them into ``content``.

        Returns whether that changed anything.
        """
        signal = self._captured.get(memory["D_I"], self._captured.get(bus_of(memory)))
        if signal is None:
            return False
        address, writing = levels[memory["A"]], _writes(memory, levels)
        reading = reads(memory, levels)
        begins = np.flatnonzero(
            (np.diff(address, prepend=-1) != 0) | np.diff(reading, prepend=False)
        )
        begins = begins[reading[begins] & (begins >= self._first)]
        times = self._times[self._last]
        moved = np.append(
            np.flatnonzero((np.diff(address) != 0) | np.diff(reading)) + 1, len(times) - 1
        )
        ends = times[moved[np.searchsorted(moved, begins, side="right").clip(max=len(moved) - 1)]]
        # Late enough for the memory, early enough for the analyser's skew.
        level, known = signal.at(times[begins] + (ends - times[begins]) * 3 // 4)
        ended = np.flatnonzero(writing[:-1] & (~writing[1:] | (np.diff(address) != 0)))
        ended = ended[ended >= self._first]
        written = np.full(len(content), len(times))
        np.minimum.at(written, address[ended], ended)
        useful = (known == 0xFF) & (begins <= written[address[begins]])
        places, bytes_read = address[begins][useful][::-1], level[useful][::-1]
        before = content.copy()
        content[places] = bytes_read  # the first one of an address remains
        learned[places] = True
        return bool((content != before).any())

    def _require_pixel_clocks(self, levels: Mapping[str, Levels]) -> None:
        wiring = self._wiring
        missing = [camera for camera in wiring.cameras if camera.clock not in self._inputs]
        if not missing:
            return
        lines = [pin for pin in (*wiring.mcu_pins, *wiring.acknowledges) if wiring.widths[pin] == 1]
        lines = [pin for pin in lines if pin != wiring.data_clock][:62]
        codes = sum((levels[pin] << bit for bit, pin in enumerate(lines)), np.int64(0))
        for place in np.unique(codes, return_index=True)[1]:
            storing = wiring.storing(lambda pin, place=place: int(levels[pin][place]))  # type: ignore[misc]
            for camera in missing:
                if camera.name in storing and camera.clock not in self._given:
                    at_ns = self._times[self._last][place] / 1000
                    raise CaptureError(
                        f"{camera.clock} was not captured, but an image is stored from"
                        f" {at_ns:.10g} ns on; --hold {camera.clock}=0 if it did not move"
                    )


def _other_memories(
    memories: Memories, learned: Mapping[str, NDArray[np.bool_]]
) -> Iterator[Memories]:
    """Contents that agree in the bytes that were learned."""
    yield {name: np.where(learned[name], memory, ~memory) for name, memory in memories.items()}
    for seed in _MEMORY_SEEDS:
        random = np.random.default_rng(seed)
        yield {
            name: np.where(learned[name], memory, random.integers(0, 256, len(memory), np.uint8))
            for name, memory in memories.items()
        }


def bus_of(memory: MemoryPins) -> str:
    """The pin of a memory's data bus."""
    return memory["D_I"].removesuffix("_I")


def reads(memory: MemoryPins, levels: Mapping[str, Levels]) -> NDArray[np.bool_]:
    ce_n, oe_n, we_n = (levels[memory[pin]] for pin in ("CE_N", "OE_N", "WE_N"))
    return np.asarray((ce_n == 0) & (oe_n == 0) & (we_n == 1))


def _writes(memory: MemoryPins, levels: Mapping[str, Levels]) -> NDArray[np.bool_]:
    return np.asarray((levels[memory["CE_N"]] == 0) & (levels[memory["WE_N"]] == 0))
