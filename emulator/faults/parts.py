"""Faults of parts: cameras, memories, the FPGA's registers, supplies, processors.

In memory, radiation inverts bits, each with the same probability.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import simpy
from numpy.typing import NDArray

from cubestack.emulator.faults import table
from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.faults.injection import Injection, Mechanism, Report, active
from cubestack.emulator.faults.pins import PinFaults
from cubestack.emulator.faults.pixels import FaultySource
from cubestack.emulator.faults.sites import CameraSite, CoreSite
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

if TYPE_CHECKING:
    from cubestack.emulator.rtl.contract import RtlEngine

Steps = Generator[simpy.Event, Any, None]

MOST_UPSETS_PER_S = 10_000.0
"""Rate of memory upsets above which they are applied in batches, every ``BATCH_S``."""

BATCH_S = 1e-3


class CameraFaults(Mechanism):
    """Faults of a camera: of its output, and its failure."""

    def __init__(
        self,
        env: Kernel,
        report: Report,
        engine: "RtlEngine",
        name: str,
        site: CameraSite,
        power: PowerModel,
    ) -> None:
        super().__init__(env, report)
        self._engine, self._name, self._site, self._power = engine, name, site, power
        source = FaultySource(site.source, report, self.injections)
        switched = power.on_switch

        def follow(channel: str, on: bool) -> None:
            switched(channel, on)
            if on and channel == site.channel and self._is_dead:
                site.power(False, self._now_ps())

        power.on_switch = follow
        engine.attach(source, name)

    @property
    def _is_dead(self) -> bool:
        return bool(active(self.injections, table.CameraDead, self.env.now))

    def _now_ps(self) -> int:
        """Run the engine to the present, which it may be ahead of; returns its time."""
        now_ps = max(self.env.now, self._engine.now_ps)
        self._engine.run(now_ps)
        return now_ps

    def prepare(self, injection: Injection) -> None:
        """Store it, as the affected lines depend on its time."""
        self.injections.append(injection)

    def begin(self, injection: Injection) -> None:
        now_ps = self._now_ps()
        if isinstance(injection.fault, table.CameraDead):
            self.report(now_ps, injection, "no clock, no answer")
            self._site.power(False, now_ps)
        self._engine.stream_changed(self._name)

    def end(self, injection: Injection) -> None:
        now_ps = self._now_ps()
        super().end(injection)
        if isinstance(injection.fault, table.CameraDead) and not self._is_dead:
            self.report(now_ps, injection, "is back")
            self._site.power(self._power.is_on(self._site.channel), now_ps)
        self._engine.stream_changed(self._name)


class MemoryFaults(Mechanism):
    """Flipped and stuck bits of one memory."""

    def __init__(
        self,
        env: Kernel,
        report: Report,
        memory: NDArray[np.uint8],
        engine: "RtlEngine | None" = None,
        pins: Callable[[], PinFaults] | None = None,
        changed: Callable[[int, int], None] = lambda _first, _count: None,
    ) -> None:
        """``changed`` is called with the first changed byte and the number of bytes.

        ``pins`` returns the mechanism that reports reads of the FPGA's memories; None without FPGA.
        """
        super().__init__(env, report)
        self._memory = memory
        self._engine = engine
        self._stuck: dict[Injection, tuple[int, int]] = {}
        self._pins, self._changed = pins, changed

    def prepare(self, injection: Injection) -> None:
        """Reject stuck bits in a memory whose reads are not observable."""
        if isinstance(injection.fault, table.MemoryStuck) and self._pins is None:
            raise FaultError(
                "memory-stuck: only a memory of a device with an FPGA can have stuck bits"
            )

    def begin(self, injection: Injection) -> None:
        self._advance()
        fault = injection.fault
        match fault:
            case table.MemoryFlip():
                address, bit = self._place(injection, fault)
                self._flip(injection, 8 * address + bit)
            case table.MemoryStuck():
                if not self._stuck and self._pins is not None:
                    self._pins().around_reads.append(self._hold)
                self._stuck[injection] = self._place(injection, fault)
                self._hold()
            case table.MemoryUpsets():
                self.injections.append(injection)
                self.env.process(self._upsets(injection, fault))

    def end(self, injection: Injection) -> None:
        super().end(injection)
        if self._stuck.pop(injection, None) and not self._stuck and self._pins is not None:
            self._pins().around_reads.remove(self._hold)

    def _place(
        self, injection: Injection, fault: table.MemoryFlip | table.MemoryStuck
    ) -> tuple[int, int]:
        address = injection.draw(fault.address, self._memory.size, 1)
        return address, injection.draw(fault.bit, 8, 2)

    def _advance(self) -> None:
        if self._engine is not None:
            self._engine.run(max(self.env.now, self._engine.now_ps))

    def _flip(self, injection: Injection, place: int) -> None:
        flip_bit(self._memory, place)
        self._changed(place // 8, 1)
        self.report(self.env.now, injection, f"byte {place // 8:#x}, bit {place % 8}")

    def _upsets(self, injection: Injection, fault: table.MemoryUpsets) -> Steps:
        bits, generator = 8 * self._memory.size, injection.generator
        per_s = fault.rate * bits
        one_by_one = per_s <= MOST_UPSETS_PER_S
        while True:
            wait_s = float(generator.exponential(1 / per_s)) if one_by_one else BATCH_S
            yield self.env.timeout(max(1, round(wait_s * PS_PER_S)))
            if injection not in self.injections:
                return
            self._advance()
            if one_by_one:
                self._flip(injection, int(generator.integers(bits)))
            else:
                places = generator.integers(bits, size=generator.poisson(per_s * BATCH_S))
                masks = np.left_shift(1, places % 8).astype(np.uint8)
                np.bitwise_xor.at(self._memory, places // 8, masks)
                self._changed(0, self._memory.size)
                self.report(self.env.now, injection, f"{len(places)} bits")

    def _hold(self) -> None:
        for injection, (address, bit) in self._stuck.items():
            fault = injection.fault
            assert isinstance(fault, table.MemoryStuck)
            if self._memory[address] >> bit & 1 != fault.level:
                flip_bit(self._memory, 8 * address + bit)
                self._changed(address, 1)
                text = f"byte {address:#x}, bit {bit} does not hold"
                self.report(self.env.now, injection, text)


@dataclass(eq=False)
class CoreFaults(Mechanism):
    """Flipped bits of a core's registers."""

    core: CoreSite

    def prepare(self, injection: Injection) -> None:
        """Reject an unknown register; FaultError."""
        if isinstance(injection.fault, table.CoreFlip | table.RegisterFlip):
            self._place(injection, injection.fault)

    def begin(self, injection: Injection) -> None:
        fault = injection.fault
        if isinstance(fault, table.CoreFlip | table.RegisterFlip):
            self._flip(injection, *self._place(injection, fault))
        elif isinstance(fault, table.CoreUpsets | table.RegisterUpsets):
            self.injections.append(injection)
            self.env.process(self._upsets(injection, fault.rate))

    def _place(
        self, injection: Injection, fault: table.CoreFlip | table.RegisterFlip
    ) -> tuple[str, int]:
        registers, name = self.core.registers, fault.register
        if name is None:
            name = list(registers)[injection.draw(None, len(registers), 1)]
        if name not in registers:
            raise FaultError(f"{fault.kind}: no register {name!r}, only {', '.join(registers)}")
        return name, injection.draw(fault.bit, registers[name], 2)

    def _flip(self, injection: Injection, register: str, bit: int) -> None:
        self.core.flip(register, bit)
        self.report(self.env.now, injection, f"{register}[{bit}]")

    def _upsets(self, injection: Injection, rate: float) -> Steps:
        places = [(name, bit) for name, bits in self.core.registers.items() for bit in range(bits)]
        while True:
            wait_s = float(injection.generator.exponential(1 / (rate * len(places))))
            yield self.env.timeout(max(1, round(wait_s * PS_PER_S)))
            if injection not in self.injections:
                return
            self._flip(injection, *places[int(injection.generator.integers(len(places)))])


@dataclass(eq=False)
class RegisterFaults(CoreFaults):
    """Flipped bits of the FPGAs' registers."""

    core: "RtlEngine"

    def prepare(self, injection: Injection) -> None:
        """Reject an unknown register, and an engine without registers; ValueError."""
        if not self.core.registers:
            self.core.flip("", 0)  # raises the error
        super().prepare(injection)

    def _place(
        self, injection: Injection, fault: table.CoreFlip | table.RegisterFlip
    ) -> tuple[str, int]:
        registers, name, bit = self.core.registers, fault.register, fault.bit
        if name is not None and (bit or 0) not in range(registers.get(name, 0)):
            self.core.flip(name, bit or 0)  # raises the error
        return super()._place(injection, fault)

    def _flip(self, injection: Injection, register: str, bit: int) -> None:
        self.core.run(max(self.env.now, self.core.now_ps))
        super()._flip(injection, register, bit)


@dataclass(eq=False)
class SupplyFaults(Mechanism):
    """Latch-ups, which end when the channel is switched off."""

    power: PowerModel

    def begin(self, injection: Injection) -> None:
        fault = injection.fault
        assert isinstance(fault, table.LatchUp)
        on = "" if self.power.is_on(injection.target) else ", but it is off"
        self.report(self.env.now, injection, f"{fault.extra_ma:g} mA on top{on}")
        self.power.latch_up(injection.target, fault.extra_ma, lasting=fault.lasting)


@dataclass(eq=False)
class ProcessorFaults(Mechanism):
    """Faults that reset the processor, all with the same cause."""

    reset: Callable[[], None]

    def begin(self, injection: Injection) -> None:
        self.report(self.env.now, injection, "resets the processor")
        self.reset()


def flip_bits(memory: NDArray[np.uint8], rate: float, generator: np.random.Generator) -> int:
    """Invert each bit of ``memory`` with probability ``rate``, 0..1; return their number."""
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate of bit flips must be 0 to 1 per bit, not {rate:g}")
    bits = 8 * memory.size
    count = int(generator.binomial(bits, rate))
    for place in generator.choice(bits, count, replace=False, shuffle=False):
        flip_bit(memory, int(place))
    return count


def flip_bit(memory: NDArray[np.uint8], place: int) -> None:
    """Invert bit ``place``, counted from the lowest bit of the first byte."""
    memory[place // 8] ^= np.uint8(1 << place % 8)
