"""SunSlit's firmware: reads the array through the FPGA, and finds the Sun."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.sensor import (
    Action,
    AwaitPin,
    Meter,
    NodeHardware,
    NodeProgram,
    Pay,
    ReadTimer,
    Routine,
    SetPin,
    Source,
    StrobeRead,
    pause,
)
from linear_sun_sensor.interface import INTERFACE, PITCH_MM, PIXELS, SLIT_MM, Outcome
from linear_sun_sensor.pins import ACK, ENABLE, EXPOSE, RNW

READOUT_US = 2_000
"""A readout takes 256 us after the end of the exposure."""

POLL_CYCLES, READ_CYCLES = 8, 24
"""Of the acknowledge; of a byte from the FPGA."""


@dataclass
class Measurement:
    """The latest measurement; see telemetry SunAngle."""

    angle: float = 0.0
    centroid: float = 0.0
    peak: int = 0
    outcome: Outcome = Outcome.NOT_MEASURED
    duration: float = 0.0


class SunSlitProgram(NodeProgram):
    """One life of the program, from reset to reset.

    Attributes:
        latest: the latest measurement.
    """

    interface = INTERFACE

    def __init__(self, hardware: NodeHardware, meter: Meter) -> None:
        super().__init__(hardware, meter)
        self._memory = np.zeros(2 * PIXELS, np.uint8)  # both readouts
        self.latest = Measurement()

    def actions(self) -> Mapping[str, Action]:
        return {"Measure": self._measure}

    def sources(self) -> Mapping[str, Source]:
        return {
            "SunAngle": lambda: {n.capitalize(): value for n, value in vars(self.latest).items()},
            "Pixels": lambda: {"Pixels": self._memory[PIXELS:].tobytes()},
        }

    def _measure(self, _values: dict[str, Any]) -> Routine[None]:
        began_us: int = yield ReadTimer()
        stored = yield from self._expose()
        self.latest = result = Measurement()
        if stored:
            pixels = self._memory[PIXELS:]
            found = find_sun(pixels, self.settings.get("SetThreshold", "Threshold"), self.meter)
            result.peak = int(pixels.max())
            result.outcome = Outcome.NO_SUN if found is None else Outcome.MEASURED
            result.centroid, result.angle = found or (0.0, 0.0)
        else:
            self.state.raise_flag("ReadoutError")
            result.outcome = Outcome.NO_READOUT
        yield Pay()
        ended_us: int = yield ReadTimer()
        result.duration = (ended_us - began_us) / 1000

    def _expose(self) -> Routine[bool]:
        """Integrate, and read both readouts; False when the FPGA does not acknowledge."""
        yield SetPin(RNW, 0)
        yield SetPin(ENABLE, 1)
        yield SetPin(EXPOSE, 1)
        yield from pause(self.settings.get("SetExposure", "Exposure"))
        yield SetPin(EXPOSE, 0)
        stored: bool = yield AwaitPin(ACK, 1, READOUT_US, POLL_CYCLES)
        if stored:
            yield SetPin(RNW, 1)
            yield StrobeRead(self._memory, READ_CYCLES)
        yield SetPin(ENABLE, 0)
        return stored


def find_sun(pixels: NDArray[np.uint8], threshold: int, meter: Meter) -> tuple[float, float] | None:
    """Centroid in px and angle in degrees; None when no pixel is ``threshold`` above the darkest.

    The centroid takes one pixel more at either side of those, each above the darkest one.
    """
    meter.charge(ram_read=2 * PIXELS, i32_add=3 * PIXELS, loop=2 * PIXELS)
    light = pixels.astype(np.int32) - int(pixels.min())
    (bright,) = np.nonzero(light >= threshold)
    if not len(bright):
        return None
    first, end = max(0, int(bright[0]) - 1), min(PIXELS, int(bright[-1]) + 2)
    count = end - first
    meter.charge(ram_read=count, i32_add=2 * count, i32_mul=count, loop=count)
    meter.charge(f32_convert=2, f32_div=1, f32_add=1, f32_mul=2, f32_atan2=1)
    part = light[first:end]
    centroid = np.float32((part * np.arange(first, end)).sum()) / np.float32(part.sum())
    offset = (centroid - np.float32((PIXELS - 1) / 2)) * np.float32(PITCH_MM)
    angle = np.arctan2(offset, np.float32(SLIT_MM)) * np.float32(180 / pi)
    return float(centroid), float(angle)
