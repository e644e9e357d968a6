"""Couples a machine's port pins to an FPGA.

The machine calls the driver of a compiled FPGA directly, without Python. It reaches any other FPGA,
and one with faults at its pins, by callbacks, with the same results.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from cubestack.emulator.iss import binding
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.sim.fpga_port import FpgaPort, Transactions
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.mcu.external_bus import EBI


@dataclass(frozen=True)
class FpgaPin:
    """A pin of the FPGA, or a bus, connected to neighbouring port pins."""

    name: str  # name of the FPGA's pin
    # the machine's port pin of the lowest bit
    port: int
    bit: int
    width: int = 1
    input: bool = False  # the FPGA drives it
    alert: bool = False  # changes also raise the machine's pin interrupts


class FpgaCoupling:
    """Connection of a machine's pins to an FPGA, or to a fault at the FPGA's pins."""

    def __init__(
        self,
        machine: Machine,
        fpga: FpgaPort,
        pins: Sequence[FpgaPin],
        *,
        banks: Sequence[int] = (),
        compiled: bool = True,
    ) -> None:
        """Couple them.

        Args:
            pins: the connections; the caller handles all other outputs of the machine.
            banks: chip select of each bank of the machine's external bus that leads to the FPGA.
            compiled: use the FPGA's compiled functions if it has any.
        """
        self._machine, self.fpga, self._banks = machine, fpga, tuple(banks)
        self._pins, self._by_driver = tuple(pins), compiled and not banks
        self._error: BaseException | None = None
        self._callbacks = (
            binding.ATTEND(self._guard(fpga.attend, 0)),
            binding.SLOW_GET(self._guard(self._get, 0)),
            binding.SLOW_SET(self._guard(self._set, None)),
            binding.SLOW_EXTERNAL(self._guard(self._external, -1)),
        )
        self._couple()

    def _couple(self) -> None:
        self._driver = driver = self.fpga.driver if self._by_driver else None
        self._reported = -1  # the running cameras that the machine was last given
        addresses = (0, 0, 0, 0) if driver is None else driver[:4]
        numbers = (
            range(len(self._pins))
            if driver is None
            else [driver.pins[pin.name] for pin in self._pins]
        )
        wires = [
            binding.FpgaWireRecord(pin.port, pin.bit, pin.width, number, pin.input, pin.alert)
            for pin, number in zip(self._pins, numbers, strict=True)
        ]
        record = binding.FpgaDriverRecord(*addresses, *self._callbacks)
        self._machine.couple(record, (binding.FpgaWireRecord * len(wires))(*wires))

    def before_run(self) -> None:
        """Give the machine the set of running cameras; call before it runs."""
        if self._by_driver and self.fpga.driver is not self._driver:
            self._couple()  # a fault at the pins began or ended
        running = self.fpga.running
        if running or self._reported:
            self._machine.fpga_running(running)
            self._reported = running

    def after_run(self, time_ps: int) -> None:
        """Run the FPGA up to ``time_ps``; raises what a callback raised in the machine's run."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        self.fpga.run(max(self.fpga.now_ps, time_ps))

    def set_pin(self, name: str, value: int, time_ps: int) -> None:
        """Drive a pin whose changes the machine reports to Python."""
        self.fpga.run(max(self.fpga.now_ps, time_ps))
        self.fpga.set_pin(name, value)

    def _get(self, pin: int, now_ps: int) -> int:
        self.fpga.run(max(self.fpga.now_ps, now_ps))
        return self.fpga.get_pin(self._pins[pin].name)

    def _set(self, pin: int, value: int, now_ps: int) -> None:
        self.fpga.run(max(self.fpga.now_ps, now_ps))
        self.fpga.set_pin(self._pins[pin].name, value)

    def _external(self, bank: int, address: int, value: int, now_ps: int) -> int:
        """Perform one access on the external bus, which began before its data phase."""
        if bank not in self._banks:
            return -1
        self.fpga.run(max(self.fpga.now_ps, now_ps))
        write = value >= 0
        data = np.array([value if write else 0], np.uint8)
        addresses = np.array([address & 0xFF_FFFF], np.int32)
        cycle = Fraction(PS_PER_S, max(1, self._machine.hz))
        select = self._banks.index(bank)
        wanted = Transactions(addresses, data, write, cycle, EBI.cycles, select)
        self.fpga.access(wanted, self.fpga.now_ps + int(wanted.period) + 1)
        return int(data[0])

    def _guard(self, act: Callable[..., int | None], failed: int | None) -> Callable[..., object]:
        """Wrap ``act`` for compiled code, through which exceptions can not propagate."""

        def call(*arguments: int) -> object:
            try:
                return act(*arguments)
            except BaseException as error:
                self._error = self._error or error
                self._machine.stop()
                return failed

        return call
