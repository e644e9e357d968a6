"""Levels at pins over time, from a VCD file (IEEE 1364-2005, section 18).

A variable with a pin's name, such as PB9, drives that pin; x and z release it. Time 0 of the file
is the power-up. Variables of other names are not allowed, and each pin has one.
"""

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import simpy

from cubestack.emulator.boards.pins import Pins
from cubestack.emulator.rtl.capture.read_vcd import read_vcd
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.efm32gg.pins import PINS


@dataclass(frozen=True)
class Stimulus:
    """Changes by time: time in ps since power-up, pin, level; -1 releases."""

    changes: tuple[tuple[int, str, int], ...]

    @classmethod
    def load(cls, path: Path) -> "Stimulus":
        """Read a file; ValueError names it and what is wrong."""
        capture = read_vcd(path)
        names = [channel.name for channel in capture.channels]
        for number, channel in enumerate(capture.channels):
            what = f"{path} has the variable {channel.full_name}"
            if channel.name not in PINS:
                raise ValueError(f"{what}; it must be a pin, PA0 to PF15")
            if channel.width != 1:
                raise ValueError(f"{what} of {channel.width} bits; a pin has one")
            if channel.name in names[:number]:
                raise ValueError(f"{what} twice; a pin has one")
        columns = (capture.times.tolist(), capture.numbers.tolist(), capture.levels.tolist())
        changes = zip(*columns, strict=True)
        return cls(tuple((time, names[number], level) for time, number, level in changes))

    def applied(self, kernel: Kernel, pins: Pins) -> Generator[simpy.Event, Any, None]:
        """A process of ``kernel`` that drives ``pins``, from time 0 on."""
        for time_ps, pin, level in self.changes:
            if time_ps > kernel.now:
                yield kernel.timeout(time_ps - kernel.now)
            if level < 0:
                del pins[pin]
            else:
                pins[pin] = level
