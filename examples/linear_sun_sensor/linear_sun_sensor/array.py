"""The photodiode array behind its slit, with its converter, after the TSL1401CL's data sheet.

A start pulse that a rising clock finds high puts the pixels out, one with each clock after it, and
ends their integration; the next one begins at once (the 18 clocks of reset are left out, and so are
lag and the spread of light in the glass). The converter gives a pixel to the FPGA one clock later.
"""

from collections.abc import Callable
from fractions import Fraction
from math import cos, radians, tan

import numpy as np
from numpy.typing import NDArray

from cubestack.sensor import PixelClock, StreamSegment
from linear_sun_sensor.interface import PITCH_MM, PIXELS, SLIT_MM
from linear_sun_sensor.scene import SlitScene

CLOCK_HZ = 500_000
SLIT_WIDTH_MM = 0.2
SUN_RADIUS = radians(0.2665)

DN_PER_US = 0.08
"""Of a pixel in full sunlight, behind a dark filter: assumed."""

DARK_DN, NOISE_DN = 6.0, 0.8
"""Of the whole chain: assumed."""


class LinearArray:
    """A ``PixelSource`` that sends a row when the FPGA requests it.

    Attributes:
        powered: whether it has its supply.
    """

    line_clocks = active_columns = PIXELS

    def __init__(self, scene: Callable[[], SlitScene], start: Callable[[], int]) -> None:
        """Look at what ``scene`` gives; ``start`` gives the level of the start pulse."""
        self._scene = scene
        self._start = start
        self.powered = True
        self._clock = PixelClock(CLOCK_HZ)
        self._first = 0  # clock at which the segment begins
        self._segment = self._clocks(0, 1)
        self._started = -(10**9)  # clock that found the latest start pulse
        self._integrated_us = 0.0
        self._readouts = 0

    @property
    def period(self) -> Fraction:
        """Time of a clock in ps."""
        return self._clock.period

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        """A row after a start pulse; else single clocks, as each may find one."""
        if not self.powered:
            return None
        clock = self._clock.first_edge(time_ps + 1) - 1
        if not self._first <= clock < self._first + self._segment.clocks:
            row = clock == self._started + 1
            if self._start() and not row:
                self._integrated_us = (clock - self._started) * 1e6 / CLOCK_HZ
                self._started = clock
                self._readouts += 1
            self._first, self._segment = clock, self._clocks(clock, PIXELS if row else 1)
        return self._segment

    def _clocks(self, clock: int, count: int) -> StreamSegment:
        row = count == PIXELS
        pixels = self._pixels if row else None
        return StreamSegment(self._clock.edge_ps(clock), count, 0, int(row), pixels)

    def _pixels(self) -> NDArray[np.uint8]:
        """The latest integration, shape (1, PIXELS)."""
        scene = self._scene()
        full = self._integrated_us * DN_PER_US * scene.brightness
        levels = DARK_DN + full * _lit(scene.sun_deg)
        if scene.noise:
            rng = np.random.default_rng([scene.seed, self._readouts])
            levels = levels + rng.normal(0, NOISE_DN + 0.02 * np.sqrt(levels))
        return np.clip(np.rint(levels), 0, 255).astype(np.uint8).reshape(1, PIXELS)


def _lit(sun_deg: float) -> NDArray[np.float64]:
    """Part (PIXELS,) of each pixel that is in the light, its slant included."""
    if abs(sun_deg) > 89:
        return np.zeros(PIXELS)
    angle = radians(sun_deg)
    # The edges of the light: the Sun's disc is not a point.
    middle, blur = SLIT_MM * tan(angle), SLIT_MM * SUN_RADIUS / cos(angle) ** 2
    borders = (np.arange(PIXELS + 1) - PIXELS / 2) * PITCH_MM
    ramp = np.zeros(PIXELS + 1)
    for part in (-0.75, -0.25, 0.25, 0.75):
        left = middle + part * blur - SLIT_WIDTH_MM / 2
        ramp += np.clip(borders - left, 0, SLIT_WIDTH_MM) / 4
    return np.diff(ramp) / PITCH_MM * cos(angle)
