"""Benchmarks of engines: first builds, and a camera that repeats one frame."""

import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.native.cache import collected
from cubestack.emulator.native.compiler import NoCompilerError, find_compiler
from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.wiring import Wiring

ROUNDS = 5
"""Repetitions of a measurement; the shortest counts, as other processes disturb the rest."""


def cold_build_s(wiring: Wiring) -> float:
    """Wall time in s to build a design's shared library with this machine's compiler.

    Raises NoCompilerError.
    """
    compiler = find_compiler()
    if compiler is None:
        raise NoCompilerError("no C++ compiler to measure")
    with collected() as recipes, suppress(NoCompilerError):
        library_for(wiring)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = time.perf_counter()
        recipes[0].build(compiler, folder, folder / "log")
        return time.perf_counter() - start


@dataclass(frozen=True)
class _Segment:
    """Blanking, or all lines of the image."""

    start_ps: int
    clocks: int
    rows: int
    pixels: Callable[[], NDArray[np.uint8]] | None
    vsync: int = 1


@dataclass(frozen=True)
class RepeatedFrame:
    """A :class:`~cubestack.emulator.rtl.pixel_clock.PixelSource`: blanking, then the image."""

    image: NDArray[np.uint8]  # (rows, columns)
    period: Fraction  # period of the pixel clock in ps
    line_clocks: int  # clocks from one line to the next
    blank_clocks: int = 0  # clocks before the first line

    @property
    def active_columns(self) -> int:
        return len(self.image[0])

    @property
    def clocks(self) -> int:
        return self.blank_clocks + len(self.image) * self.line_clocks

    def segment_at(self, time_ps: int) -> _Segment:
        # The last frame that begins at this time or before, its start rounded down.
        first = (ceil((time_ps + 1) / (self.clocks * self.period)) - 1) * self.clocks
        image_ps = int((first + self.blank_clocks) * self.period)
        if time_ps < image_ps:
            return _Segment(int(first * self.period), self.blank_clocks, 0, None)
        lines = len(self.image)
        return _Segment(image_ps, lines * self.line_clocks, lines, lambda: self.image)
