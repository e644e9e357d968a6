"""Faults between processor and FPGA: wrong acknowledges, glitches on control pins, a dead FPGA.

The mechanism replaces the processor's FPGA port, and forwards everything else.
"""

from collections.abc import Callable, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.faults.injection import Injection, Mechanism, Report, active
from cubestack.emulator.faults.table import AckLate, AckLost, AckStuck, ControlGlitch, FpgaDead
from cubestack.emulator.sim.fpga_port import Driver, FpgaPort, Transactions
from cubestack.emulator.sim.virtual_time import PS_PER_US, Kernel

PS_PER_NS = 1000


class PinFaults(Mechanism, FpgaPort):
    """An FPGA port with faults at its pins.

    Attributes:
        around_reads: called before and after bytes are read from the FPGA.
    """

    def __init__(
        self,
        env: Kernel,
        report: Report,
        engine: FpgaPort,
        data: str = "",
        fpgas: Mapping[str, tuple[str, int]] = MappingProxyType({}),
    ) -> None:
        """Replaces ``engine``; ``data`` are the pins for reading single bytes, ``fpgas`` as in
        ``Sites``."""
        super().__init__(env, report)
        self._engine, self._data, self._fpgas = engine, data, fpgas
        self._forced: dict[str, int] = {}
        self._held: dict[str, int] = {}  #: levels that a dead FPGA's pins keep
        self._driven: dict[str, int] = {}
        self._rose_ps: dict[str, int] = {}
        self.around_reads: list[Callable[[], None]] = []

    def begin(self, injection: Injection) -> None:
        if isinstance(injection.fault, ControlGlitch):
            self.env.process(self._glitch(injection, injection.fault))
            return
        self.injections.append(injection)
        if isinstance(injection.fault, FpgaDead):
            pin, level = self._fpgas[injection.target]
            self._held[pin] = level
            self._force(pin)
            self.report(self.env.now, injection, f"does nothing, as with {pin} at {level}")
            return
        level = self._engine.get_pin(injection.target)
        self.report(self.env.now, injection, f"begins with the pin at {level}")

    def end(self, injection: Injection) -> None:
        super().end(injection)
        if isinstance(injection.fault, FpgaDead) and not any(
            injection.target == other.target
            for other, _ in active(self.injections, FpgaDead, self.env.now)
        ):
            pin, _ = self._fpgas[injection.target]
            self._held.pop(pin, None)
            self._force(pin)

    def _force(self, pin: str) -> None:
        """Drive the level that a fault, or else the processor, wants."""
        self._engine.run(max(self.env.now, self._engine.now_ps))
        self._driven.setdefault(pin, self._engine.get_pin(pin))
        level = self._held.get(pin, self._forced.get(pin, self._driven[pin]))
        self._engine.set_pin(pin, level)

    # --- FpgaPort -------------------------------------------------------------------------------

    @property
    def now_ps(self) -> int:
        return self._engine.now_ps

    @property
    def running(self) -> int:
        return self._engine.running

    @property
    def driver(self) -> Driver | None:
        """None while a fault needs every access."""
        needed = self.injections or self._forced or self._held or self.around_reads
        return None if needed else self._engine.driver

    def attend(self, reached_ps: int, end: int, camera: int, until_ps: int) -> int:
        return self._engine.attend(reached_ps, end, camera, until_ps)

    def set_pin(self, name: str, value: int) -> None:
        """Drive a pin; during a glitch, the level takes effect after it."""
        self._driven[name] = value
        if name not in self._forced and name not in self._held:
            self._engine.set_pin(name, value)

    def get_pin(self, name: str) -> int:
        """Level of a pin for the processor."""
        if name == self._data:
            for act in self.around_reads:
                act()
        level = self._engine.get_pin(name)
        for injection, fault in self._on(name):
            match fault:
                case AckStuck():
                    level = fault.level
                case AckLost():
                    if level and injection.hits < 2:
                        self.report(self.env.now, injection, f"{name} rise not seen")
                    level = 0
                case AckLate() if level:
                    rose_ps = self._rose_ps.setdefault(name, self._engine.now_ps)
                    level = int(self._engine.now_ps >= rose_ps + _delay_ps(fault))
        if not self._engine.get_pin(name):
            self._rose_ps.pop(name, None)
        return level

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps``, or until the processor sees ``stop_on``."""
        self._note_rises(until_ps)
        if stop_on is None or not self._on(stop_on[0]):
            return self._engine.run(until_ps, stop_on)
        pin, level = stop_on
        if self.get_pin(pin) == level:
            return self._engine.now_ps
        late = [fault for _, fault in self._on(pin) if isinstance(fault, AckLate)]
        if level and late and pin in self._rose_ps:
            visible_ps = self._rose_ps[pin] + max(map(_delay_ps, late))
            if visible_ps > self._engine.now_ps:  # else another fault hides it
                until_ps = min(until_ps, visible_ps)
        return self._engine.run(until_ps)

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        return self._between_reads(lambda: self._engine.strobe_read(out, period, until_ps))

    def access(self, transactions: Transactions, until_ps: int) -> int:
        return self._between_reads(lambda: self._engine.access(transactions, until_ps))

    def _between_reads(self, take: Callable[[], int]) -> int:
        for act in self.around_reads:
            act()
        done = take()
        for act in self.around_reads:
            act()
        return done

    # --------------------------------------------------------------------------------------------

    def _on(self, pin: str) -> list[tuple[Injection, AckLate | AckLost | AckStuck]]:
        now_ps = self.env.now
        mine = [injection for injection in self.injections if injection.target == pin]
        return [
            *active(mine, AckLate, now_ps),
            *active(mine, AckLost, now_ps),
            *active(mine, AckStuck, now_ps),
        ]

    def _note_rises(self, until_ps: int) -> None:
        """Stop at the rise of a delayed acknowledge, and store its time."""
        for injection, _ in active(self.injections, AckLate, self.env.now):
            pin = injection.target
            if self._engine.get_pin(pin):
                continue
            self._rose_ps.pop(pin, None)
            if self._engine.run(until_ps, (pin, 1)) and self._engine.get_pin(pin):
                self._rose_ps[pin] = self._engine.now_ps
                self.report(self._engine.now_ps, injection, "rises")

    def _glitch(self, injection: Injection, fault: ControlGlitch) -> Any:
        pin = injection.target
        if pin not in self._forced:
            self._driven.setdefault(pin, self._engine.get_pin(pin))
            self._forced[pin] = 1 - self._driven[pin]
            self._force(pin)
            self.report(self._engine.now_ps, injection, f"goes to {self._forced[pin]}")
            yield self.env.timeout(round(fault.width_ns * PS_PER_NS))
            del self._forced[pin]
            self._force(pin)


def _delay_ps(fault: AckLate) -> int:
    return round(fault.delay_us * PS_PER_US)
