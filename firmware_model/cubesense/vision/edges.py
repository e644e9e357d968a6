"""Edges of the Earth in the lines that the nadir FPGA scans, found while their pixels are read.

CubeSense thesis, sections 4.2.2, 6.5.1, 6.5.2 and appendices C.3 and C.4. Every 64th pixel of a
line is a sample. Between two samples on different sides of the threshold, a binary search in the
buffer finds the first bright pixel. An edge at or beyond the rim of the field of view is false. The
pixel before a line counts as dark; the text leaves that open. Boresight: table 5.1.

As printed, the buffer's first pixel is a bound of the search and the number of steps is 6, or 5,
whatever they find: if a bright line ends with a sample, the edge is found one pixel late. The edge
is the centre of the bright pixel, up to a pixel inside, so parts of the lens' rim pass the check.

An extension, with ``sub_pixel``: the previous sample is a bound, and the edge lies between the two
pixels at which the search ends, where a straight line through their values meets the threshold.

Another, with ``sharp``: an edge counts as the Earth's limb only if it is dark a few pixels outside;
the terminator and clouds fade more slowly. Both ends of a short bright run are no edges: the limb
rarely just touches a line, and the Sun is often in the field. The search's threshold is a third of
the threshold's distance from dark, because a limb in low sunlight is no brighter, and the edge is
placed half-way to the level a few pixels inside, because a dim limb meets a fixed threshold further
inside than a bright one.

Appendix C.3 has two slips that the text does not have, reproduced with ``listing``: edges of the
last 32 rows come out 224 rows too high, and the rim has a separate centre. The 1 that it adds to
positions is right for gateware as printed (appendix D.3), which presents each pixel one clock early
(``ReadOut.scan_start``); samples are one pixel further there.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.distortion import RIM_PX
from cubestack.firmware_model.cubesense.vision.masks import Mask, masked
from cubestack.firmware_model.interface.cubesense.codes import EDGE_UNIT, EDGES_PER_FRAME
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.mcu.costs import Meter

LISTED_RIM_CENTRE = (367.0, 237.0)

LISTED_REST = 32  #: pixels at a column's end; the listing halves their start

#: Distances from an edge: outside, where it must be dark even if a line grazes the limb; inside.
OUTSIDE_PX, INSIDE_PX = 6, 3

MOST_INWARDS = 3  #: largest shift inwards, in pixels, of an edge found with a low threshold
SHORT_PX = 40  #: longest bright run of a small light: the Sun with its bloom has some 25
DARK = 34  #: level of an image without light (section 5.7)

#: Edges that the part stores: assumed. The widest Earth has 28, the rest is for false ones.
MAX_EDGES = 2 * EDGES_PER_FRAME

Question = TypeVar("Question")
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class EdgeConfig:
    """Settings of the search."""

    threshold: int = 70  #: a pixel at or above it is bright
    boresight: tuple[float, float] = (371.0, 236.0)  #: (x, y) in px
    rim_px: float = RIM_PX  #: an edge at least this far from the boresight is false
    masks: Sequence[Mask] = ()  #: areas whose edges are dropped
    sub_pixel: bool = True  #: interpolate between the pixels of an edge
    listing: bool = False  #: with the slips of appendix C.3
    #: drop edges that are not dark outside; place the others by the light inside
    sharp: bool = False

    @property
    def level(self) -> int:
        """Threshold of the search in lines."""
        return DARK + (self.threshold - DARK) // 3 if self._lowered else self.threshold

    @property
    def darkest(self) -> int:
        """Largest value outside of a sharp edge: half-way from dark to bright."""
        return (self.level + DARK) // 2

    @property
    def _lowered(self) -> bool:
        return self.sharp and self.threshold > DARK


class EdgeList:
    """Edges in the order in which they were found."""

    def __init__(self, config: EdgeConfig, meter: Meter) -> None:
        self._config = config
        self._meter = meter
        self._points: list[tuple[int, int]] = []
        self._sides: list[tuple[int, int]] = []
        self._lit: list[bool] = []
        self._begun: tuple[bool, int, int, int] | None = None
        #: edges dropped at the rim, in a mask, of small lights, or because they are not sharp
        self.false = 0
        self.full = False  #: more edges were found than the part stores

    def __len__(self) -> int:
        return len(self._points)

    @property
    def points(self) -> NDArray[np.int16]:
        """Coordinates (n, 2), x and y in 1/32 px."""
        return np.array(self._points, np.int16).reshape(-1, 2)

    @property
    def sides(self) -> NDArray[np.int8]:
        """Direction of the bright side of each (n, 2): one of x and y is 1 or -1, the other 0."""
        return np.array(self._sides, np.int8).reshape(-1, 2)

    @property
    def lit(self) -> NDArray[np.bool_]:
        """Mask (n,) of the edges whose inside reaches the threshold."""
        return np.array(self._lit, bool)

    def offsets(self) -> NDArray[np.float32]:
        """Coordinates (n, 2) from the boresight in px; charges the conversion."""
        count = len(self)
        self._meter.charge(f32_convert=2 * count)
        if self._config.sub_pixel:
            self._meter.charge(f32_mul=2 * count, f32_add=2 * count)
        else:
            self._meter.charge(i16_add=2 * count)
        return self._from(self._config.boresight, self.points)

    def add(
        self, line: int, vertical: bool, crossing: "Crossing", around: tuple[int, int] | None = None
    ) -> None:
        """Check and store an edge on scanned row, or column, ``line``.

        ``around`` has the values outside and inside of an edge that must be sharp.
        """
        along, level = EDGE_UNIT * crossing.bright, self._config.level
        if around is not None:
            level = _half_way(around[1])
            self._meter.charge(i8=4)
        if self._config.sub_pixel:
            share = (crossing.bright_value - level) * EDGE_UNIT
            share //= crossing.bright_value - crossing.dark_value
            share = min(max(share, -EDGE_UNIT), 2 * EDGE_UNIT)
            along += share if crossing.dark > crossing.bright else -share
            self._meter.charge(i16_div=1, i16_add=4)
        point = (EDGE_UNIT * line, along) if vertical else (along, EDGE_UNIT * line)
        soft = around is not None and around[0] > self._config.darkest
        short = around is not None and self._ends_short(line, vertical, crossing, soft)
        if self._outside(point) or self._masked(line, vertical, crossing) or soft or short:
            self.false += 1
        elif len(self) == MAX_EDGES:
            self.full = True
        else:
            self._points.append(point)
            side = 1 if crossing.bright > crossing.dark else -1
            self._sides.append((0, side) if vertical else (side, 0))
            self._lit.append(around is None or around[1] >= self._config.threshold)

    def _ends_short(self, line: int, vertical: bool, crossing: "Crossing", soft: bool) -> bool:
        """Whether the edge ends a short bright run, whose beginning is then dropped as well.

        A soft end is a terminator, and the other end may be a crescent's limb.
        """
        self._meter.charge(i8=6, i16_add=1)
        kept = len(self)
        begun, self._begun = self._begun, None
        if soft:
            return False
        if crossing.bright > crossing.dark:
            self._begun = (vertical, line, crossing.bright, kept)
            return False
        if begun is None or begun[:2] != (vertical, line) or crossing.bright - begun[2] >= SHORT_PX:
            return False
        self.false += kept - begun[3]
        for each in (self._points, self._sides, self._lit):
            del each[begun[3] :]
        return True

    @staticmethod
    def _from(centre: tuple[float, float], points: NDArray[np.int16]) -> NDArray[np.float32]:
        """Points (..., 2) in 1/32 px, as px from ``centre``."""
        unit = np.float32(1 / EDGE_UNIT)
        return points.astype(np.float32) * unit - np.array(centre, np.float32)

    def _outside(self, point: tuple[int, int]) -> bool:
        """Equation 6.5.1 against the rim; the listing converts each factor again."""
        centre = LISTED_RIM_CENTRE if self._config.listing else self._config.boresight
        x, y = self._from(centre, np.array(point, np.int16))
        self._meter.charge(
            i16_add=8, f32_convert=4, f32_mul=2, f32_add=1, f32_sqrt=1, f32_compare=1
        )
        if self._config.sub_pixel:
            self._meter.charge(f32_mul=2, f32_add=2)
        return bool(np.sqrt(x * x + y * y) >= np.float32(self._config.rim_px))

    def _masked(self, line: int, vertical: bool, crossing: "Crossing") -> bool:
        pixel = (line, crossing.bright) if vertical else (crossing.bright, line)
        x, y = (np.array([value]) for value in pixel)
        return bool(masked(x, y, self._config.masks, self._meter)[0])


@dataclass(frozen=True)
class Crossing:
    """Two pixels of a line on different sides of the threshold: positions and values."""

    bright: int
    dark: int
    bright_value: int
    dark_value: int


def crossing(one: tuple[int, int], other: tuple[int, int], threshold: int) -> Crossing | None:
    """Crossing between two pixels of a line (position, value); None if both are on one side."""
    if (one[1] >= threshold) == (other[1] >= threshold):
        return None
    bright, dark = (one, other) if one[1] >= threshold else (other, one)
    return Crossing(bright[0], dark[0], bright[1], dark[1])


def _half_way(inside: int) -> int:
    return (inside + DARK) >> 1


def settle(edge: Crossing, meter: Meter) -> Generator[int, int, tuple[Crossing, tuple[int, int]]]:
    """Move an edge inwards to half the brightness inside; requests pixels like `bisect`.

    Returns it, and the values at a distance outside and inside.
    """
    outwards = 1 if edge.dark > edge.bright else -1
    outside = yield edge.dark + OUTSIDE_PX * outwards
    inside = yield edge.bright - INSIDE_PX * outwards
    meter.charge(i8=12, array_byte=2)
    for _ in range(MOST_INWARDS):
        meter.charge(i8=4)
        if edge.bright_value >= _half_way(inside):
            break
        further = yield edge.bright - outwards
        meter.charge(i8=6, array_byte=1, loop=1)
        if further <= edge.bright_value:
            break
        edge = Crossing(edge.bright - outwards, edge.bright, further, edge.bright_value)
    return edge, (outside, inside)


def bisect(crossing: Crossing, threshold: int, meter: Meter) -> Generator[int, int, Crossing]:
    """Narrow a wide crossing down to neighbours; requests values of positions on the line."""
    bright, dark = crossing.bright, crossing.dark
    bright_value, dark_value = crossing.bright_value, crossing.dark_value
    meter.charge(call=1)
    while abs(bright - dark) > 1:
        middle = (bright + dark) >> 1
        value = yield middle
        meter.charge(i8=6, array_byte=1, loop=1)
        if value >= threshold:
            bright, bright_value = middle, value
        else:
            dark, dark_value = middle, value
    return Crossing(bright, dark, bright_value, dark_value)


def run_search(search: Generator[Question, int, Answer], read: Callable[[Question], int]) -> Answer:
    """Run a search whose requests ``read`` answers at once."""
    try:
        question = next(search)
        while True:
            question = search.send(read(question))
    except StopIteration as end:
        answer: Answer = end.value
        return answer


@dataclass(frozen=True)
class _Piece:
    """One filling of the buffer: part of a line, or a preset's byte (no line)."""

    size: int
    line: int | None = None
    vertical: bool = False
    start: int = 0
    first: bool = False


class NadirLines:
    """Consumer of the nadir scan: read the next bytes into ``space``, then call ``filled``.

    The caller charges the transfer of the bytes (``scan_byte`` each).
    """

    def __init__(
        self,
        config: EdgeConfig,
        meter: Meter,
        read_out: ReadOut = FULL_SIZE,
        buffer: NDArray[np.uint8] | None = None,
    ) -> None:
        """``buffer`` (scan_step,) receives pixels; None creates one."""
        self.edges = EdgeList(config, meter)  #: found so far
        self._config = config
        self._meter = meter
        self._pieces = _pieces(read_out)
        self._scan_start = read_out.scan_start
        self._piece: _Piece | None = next(self._pieces)
        self._buffer = np.zeros(read_out.scan_step, np.uint8) if buffer is None else buffer
        self._previous = 0

    @property
    def wanted(self) -> int:
        """Bytes until the part examines the buffer; 0 after the last one."""
        return 0 if self._piece is None else self._piece.size

    @property
    def space(self) -> NDArray[np.uint8]:
        """Target of the next `wanted` bytes; call `filled` afterwards."""
        return self._buffer[: self.wanted]

    def filled(self) -> None:
        """Examine the bytes in `space`."""
        assert self._piece is not None
        if self._piece.line is not None:
            self._examine(self._piece, self._piece.line)
        self._piece = next(self._pieces, None)

    def _examine(self, piece: _Piece, line: int) -> None:
        """Compare the buffer's last pixel, the sample, with the previous sample."""
        before = 0 if piece.first else self._previous
        sample = int(self._buffer[piece.size - 1])
        self._previous = sample
        self._meter.charge(array_byte=2, i8=3, loop16=1)
        start, threshold = piece.start, self._config.level
        wide = crossing((start - 1, before), (start + piece.size - 1, sample), threshold)
        if wide is None:
            return
        if self._config.sub_pixel:
            steps = bisect(wide, threshold, self._meter)
            found = run_search(steps, lambda position: int(self._buffer[position - start]))
        else:
            if self._config.listing and piece.size == LISTED_REST:
                start = (start - self._scan_start) // 2 + self._scan_start
            bright = start + self._listed_search(piece.size, sample >= threshold)
            found = Crossing(bright, bright, sample, sample)
        around = None
        if self._config.sharp:

            def read(position: int) -> int:
                if position < piece.start:
                    return before
                return int(self._buffer[min(position - piece.start, piece.size - 1)])

            found, around = run_search(settle(found, self._meter), read)
        self.edges.add(line, piece.vertical, found, around)

    def _listed_search(self, size: int, rises: bool) -> int:
        """Appendix C.4: the bright pixel's position in the buffer, between its first and last."""
        light, dark = (size - 1, 0) if rises else (0, size - 1)
        steps = size.bit_length() - 1
        self._meter.charge(call=1, i8=6 * steps, array_byte=steps, loop=steps)
        for _ in range(steps):
            middle = (light + dark) >> 1
            if self._buffer[middle] >= self._config.level:
                light = middle
            else:
                dark = middle
        return light


def _pieces(size: ReadOut) -> Iterator[_Piece]:
    """The scan in the order of its clocks, divided into fillings of the buffer."""
    scans = ((size.scan_rows, size.columns), (size.scan_columns, size.rows))
    for vertical, (lines, length) in enumerate(scans):
        yield _Piece(1)
        for line, start in product(lines, range(0, length, size.scan_step)):
            pixels = min(size.scan_step, length - start)
            yield _Piece(pixels, line, bool(vertical), start + size.scan_start, not start)
