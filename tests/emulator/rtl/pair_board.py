"""CubeSense's cameras and microcontroller, for tests of its pair of FPGAs."""

from fractions import Fraction

import numpy as np

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut

from .cameras import ListCamera
from .commanded import Command

SIDES = ("sun", "nadir")
ENABLES = ("SUNEN", "NADEN")
CONTROLS = ("SHIFT", "EDGE", "RNW", *ENABLES)

#: A small picture, and one whose sides are powers of two.
SIZES = (
    ReadOut(11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1),
    ReadOut(16, 8, 7, scan_step=4, first_row=0, first_column=2, window=5, window_above=1),
)

STROBE_PERIOD = 100_000
SETTLED = 50_000  #: From an enable to the first data clock: the SRAM's access time, and more


def pair_camera(rng: np.random.Generator, size: ReadOut, frames: int = 3) -> ListCamera:
    """Whole frames with long gaps, on a clock of its own; most pixels are dark, some runs bright.

    Joined anywhere, because the first gap may be too short. One line in some ten frames is cut.
    """
    period = Fraction(10**12, int(rng.integers(9_000_000, 24_000_000)))
    line_clocks = size.columns + int(rng.integers(1, size.frame_gap))
    camera = ListCamera(period, line_clocks, size.columns)
    for number in range(frames):
        short = not number or rng.random() < 0.1
        camera.add_blank(int(rng.integers(1, size.frame_gap) if short else size.frame_gap + 3))
        image = rng.integers(0, 200, (size.rows, size.columns), dtype=np.uint8)
        x, y = int(rng.integers(0, size.columns - 1)), int(rng.integers(0, size.rows))
        image[y, x : x + int(rng.integers(1, 5))] |= 0xC8
        rows = size.rows if rng.random() < 0.9 else size.rows - 1
        camera.add_image(image[:rows])
    camera.add_blank(size.frame_gap + 3)
    return camera


class Script:
    def __init__(self, rng: np.random.Generator) -> None:
        self.commands: list[Command] = []
        self.time_ps = 2_000
        self._rng = rng
        self._levels = dict.fromkeys(CONTROLS, 0) | dict.fromkeys(ENABLES, 1)

    def wait(self, ps: float) -> None:
        self.time_ps += int(ps)

    def do(self, name: str, value: int) -> None:
        self.wait(self._rng.integers(1, 30_000))
        self.commands.append((self.time_ps, name, value))

    def standby(self) -> None:
        """A linked store's receiver first: the sender's line makes an edge of its own when it goes,
        and the lines beside it change with it."""
        order = ENABLES
        if self._levels["SHIFT"]:
            order = ENABLES if self._levels["RNW"] else ENABLES[::-1]
        for name in order:
            self.do(name, 1)

    def command(self, *levels: int) -> None:
        """From anywhere, through standby, to these levels of SHIFT, EDGE, RNW, SUNEN, NADEN."""
        self.standby()
        self._levels = dict(zip(CONTROLS, levels, strict=True))
        lines = [*self._rng.permutation(CONTROLS[:3]), *self._rng.permutation(ENABLES)]
        for name in lines:
            self.do(str(name), self._levels[str(name)])

    def read(self, count: int) -> None:
        self.wait(SETTLED)
        self.commands.append((self.time_ps, "strobe", count))
        self.wait(count * STROBE_PERIOD)


def enables(side: str) -> tuple[int, int]:
    """SUNEN and NADEN for one FPGA alone."""
    return (0, 1) if side == "sun" else (1, 0)


def stores() -> list[tuple[tuple[int, ...], tuple[str, ...]]]:
    """Each way to store: the levels, and the memories that then hold a picture."""
    return [
        ((0, 0, 0, 0, 1), ("sun",)),
        ((0, 0, 0, 1, 0), ("nadir",)),
        ((0, 0, 0, 0, 0), SIDES),
        ((1, 0, 0, 0, 0), ("nadir",)),
        ((1, 0, 1, 0, 0), ("sun",)),
    ]


def readings(memory: str, size: ReadOut) -> list[tuple[tuple[int, ...], int]]:
    """Each way to read that memory: the levels, and the number of clocks."""
    window = 4 + size.window**2
    own, other = (window, size.scan_clocks) if memory == "sun" else (size.scan_clocks, window)
    return [
        ((0, 0, 1, *enables(memory)), size.pixels),
        ((0, 1, 1, *enables(memory)), own),
        ((1, 1, int(memory == "sun"), 0, 0), other),
    ]
