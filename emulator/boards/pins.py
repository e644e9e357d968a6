"""Port pins of a processor that runs an image: their levels, and what drives them from outside."""

from collections.abc import Callable, Iterator

from cubestack.emulator.iss.outcome import Outgoing
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.efm32gg.pins import PINS, pin_number

FLOATS = "z"
"""Value in a trace of a pin that nothing drives."""


class Pins:
    """The pins by their names, ``PA0`` to ``PF15``; ValueError for others.

    Attributes:
        listeners: called with time in ps, pin and value of a trace when a pin is driven otherwise.
    """

    def __init__(self, processor: FirmwareProcessor) -> None:
        self._processor = processor
        self._outputs: dict[str, int] = {}
        self._inputs: dict[str, int] = {}
        self.listeners: list[Callable[[int, str, int | str], None]] = []

    def __iter__(self) -> Iterator[str]:
        return iter(PINS)

    def __getitem__(self, pin: str) -> int:
        """The level at a pin, 0 or 1, whatever drives it."""
        self._processor.catch_up()
        return self._processor.machine.pin_level(*divmod(pin_number(pin), 16))

    def __setitem__(self, pin: str, level: int) -> None:
        """Drive a pin from outside, with 0 or 1; what the firmware drives is stronger."""
        if level not in (0, 1):
            raise ValueError(f"the level of {pin} must be 0 or 1, not {level!r}")
        self._drive(pin, level)

    def __delitem__(self, pin: str) -> None:
        """Release a pin; its own pull-up or pull-down then decides."""
        self._drive(pin, None)

    def output(self, pin: str) -> int | None:
        """The level that the firmware drives; None for none."""
        pin_number(pin)
        return self._outputs.get(pin)

    def millivolts(self, pin: str) -> float | None:
        """The voltage that the DAC drives at a pin; None for none."""
        self._processor.catch_up()
        return self._processor.machine.pin_millivolts(*divmod(pin_number(pin), 16))

    def driven(self, pin: str) -> int | str:
        """The level that the firmware or the outside drives, or `FLOATS`."""
        return self._outputs.get(pin, self._inputs.get(pin, FLOATS))

    def wait_for(self, pin: str, level: int, timeout_s: float = 1.0) -> float:
        """Let time pass until the level at ``pin`` is ``level``; returns the time in s.

        Levels are sampled after each event of the simulation. Raises TimeoutError.
        """
        kernel = self._processor.env
        end_ps = kernel.now + round(timeout_s * PS_PER_S)
        kernel.urgent(end_ps)
        while self[pin] != level:
            if kernel.now >= end_ps:
                raise TimeoutError(f"{pin} is not {level} within {timeout_s:g} s")
            kernel.step()
        return kernel.now / PS_PER_S

    def changed(self, one: Outgoing) -> None:
        """Take a message of the machine: it drives a pin, or at -1 releases it."""
        pin = PINS[one.unit]
        if one.value < 0:
            self._outputs.pop(pin, None)
        else:
            self._outputs[pin] = one.value
        self._report(one.time_ps, pin)

    def _drive(self, pin: str, level: int | None) -> None:
        port, bit = divmod(pin_number(pin), 16)
        machine = self._processor.machine
        outside = -1 if level is None else level
        self._processor.change_inputs(lambda: machine.pin(port, bit, outside))
        if level is None:
            self._inputs.pop(pin, None)
        else:
            self._inputs[pin] = level
        self._report(self._processor.env.now, pin)

    def _report(self, time_ps: int, pin: str) -> None:
        for listener in self.listeners:
            listener(time_ps, pin, self.driven(pin))
