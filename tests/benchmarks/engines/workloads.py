"""What every engine is measured with: each top stores a frame, its pins driven the same way.

A sample is the blanking before the frame and its first lines; it counts only when the
memories then hold these lines.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

import numpy as np
from amaranth.utils import ceil_log2
from numpy.typing import NDArray

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar import wiring as cubestar
from cubestack.emulator.rtl.benchmark import RepeatedFrame
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.mlx75412 import CRYSTAL_HZ, LINE_CLOCKS
from cubestack.firmware_model.interface.cameras.ov7620 import CLOCKS_PER_LINE, PIXEL_CLOCK_HZ
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE


class WrongPictureError(RuntimeError):
    """An engine did not store what the camera sent."""


@dataclass(frozen=True)
class Workload:
    """A top that stores frames of ``columns`` x ``rows`` pixels."""

    wiring: Callable[[], Wiring]
    levels: tuple[tuple[str, int], ...]  # of the microcontroller's pins, in this order
    stored: Mapping[str, str]  # the memory that each camera's frame goes to
    columns: int
    rows: int
    line_clocks: int  # from one line to the next
    blank_clocks: int  # before the first line
    clock_hz: int

    def cameras(self) -> dict[str, RepeatedFrame]:
        """The cameras by name, each with a fixed random picture."""
        period = Fraction(PS_PER_S, self.clock_hz)
        rng = np.random.default_rng(0)
        return {
            name: RepeatedFrame(
                rng.integers(0, 256, (self.rows, self.columns), dtype=np.uint8),
                period,
                self.line_clocks,
                self.blank_clocks,
            )
            for name in self.stored
        }

    def begin(self, engine: RtlEngine) -> None:
        """Connects the cameras and sets the pins."""
        for camera, source in self.cameras().items():
            engine.attach(source, camera)
        for pin, level in self.levels:
            engine.set_pin(pin, level)

    def clocks(self, lines: int) -> int:
        """Pixel clocks of all cameras in a sample."""
        return len(self.stored) * (self.blank_clocks + lines * self.line_clocks)

    def end_ps(self, lines: int) -> int:
        """A time between the last falling edge of a sample and the next edge."""
        clocks = self.blank_clocks + lines * self.line_clocks
        return int(clocks * Fraction(PS_PER_S, self.clock_hz)) - 1

    def check(self, lines: int, memories: Mapping[str, NDArray[np.uint8]]) -> None:
        """WrongPictureError if a memory does not hold the lines of its camera."""
        width = 1 << ceil_log2(self.columns)
        for name, camera in self.cameras().items():
            memory = memories[self.stored[name]]
            found = memory[: lines * width].reshape(lines, width)[:, : self.columns]
            if not (found == camera.image[:lines]).all():
                row, column = np.argwhere(found != camera.image[:lines])[0]
                raise WrongPictureError(
                    f"{self.stored[name]} has {found[row, column]} at row {row}, column {column}, "
                    f"where the camera sent {camera.image[row, column]}"
                )


_STAR = partial(
    Workload, columns=1024, rows=512, line_clocks=LINE_CLOCKS, blank_clocks=8, clock_hz=CRYSTAL_HZ
)
_PAIR = partial(
    Workload,
    levels=(("SUNEN", 0), ("NADEN", 0)),
    stored={"sun": "sun", "nadir": "nadir"},
    columns=FULL_SIZE.columns,
    rows=FULL_SIZE.rows,
    line_clocks=CLOCKS_PER_LINE,
    # What tells it a frame's start from a line's.
    blank_clocks=FULL_SIZE.frame_gap + 20,
    clock_hz=PIXEL_CLOCK_HZ,
)

#: By the top's name. Of the pair both halves store at once, each its own camera's frame.
WORKLOADS = {
    "cubestar": _STAR(cubestar.cubestar_wiring, (("ENABLE", 1),), {"imager": "SRAM"}),
    "cubestar-shared": _STAR(cubestar.cubestar_shared_wiring, (("ENABLE", 1),), {"imager": "SRAM"}),
    "cubestar-double": _STAR(
        cubestar.cubestar_double_wiring,
        (("INTO", 1), ("RNW", 1), ("RNW", 0), ("ENABLE", 1)),
        {"imager": "SRAM2"},
    ),
    "cubestar-boards": _STAR(
        cubestar.cubestar_two_boards_wiring,
        (("BOARD1_RNW", 1), ("BOARD1_ENABLE", 1), ("BOARD2_ENABLE", 1)),
        {"imager": "SRAM2"},
    ),
    "cubesense-pair": _PAIR(cubesense_wiring),
    "cubesense-pair-addressing": _PAIR(partial(cubesense_wiring, mcu_addressing=True)),
}
