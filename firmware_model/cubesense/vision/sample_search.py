"""Edges of the Earth around a grid of samples, at addresses that the microcontroller chooses.

CubeSense thesis, section 9.2.2 (proposed, not built): each sample is compared with its neighbours
to the left and above, and pixels are examined only between samples that differ. The text leaves the
method open; both are here. The grid is that of the scanned rows and columns; pixels before it count
as dark. Edges beyond the last row or column of the grid are not found, but no edge within the rim
of the field of view lies there.
"""

from collections.abc import Generator
from enum import Enum

import numpy as np

from cubestack.firmware_model.cubesense.vision.edges import (
    Answer,
    Crossing,
    EdgeConfig,
    EdgeList,
    bisect,
    crossing,
    settle,
)
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.mcu.costs import Meter

Pixel = tuple[int, int]


class Between(Enum):
    """Search for the edge between two samples that differ."""

    SEQUENTIAL = "one pixel after the other, away from the dark sample"
    BINARY = "by halves"


def around_samples(
    config: EdgeConfig,
    meter: Meter,
    between: Between = Between.BINARY,
    read_out: ReadOut = FULL_SIZE,
) -> Generator[Pixel, int, EdgeList]:
    """Find the edges; requests the value of one pixel (x, y) after the other.

    The caller charges the reads (``address_byte`` each). The part stores the values of one row of
    the grid.
    """
    edges = EdgeList(config, meter)
    columns = read_out.scan_columns
    above = np.zeros(len(columns), np.uint8)
    for y in read_out.scan_rows:
        left = 0
        for index, x in enumerate(columns):
            sample = yield x, y
            meter.charge(array_byte=2, i8=6, loop=1)
            for vertical, before, end, line in (
                (False, left, x, y),
                (True, int(above[index]), y, x),
            ):
                first = max(end - read_out.scan_step, -1)
                wide = crossing((first, before), (end, sample), config.level)
                if wide is None:
                    continue
                last = (read_out.rows if vertical else read_out.columns) - 1
                search = bisect if between is Between.BINARY else _walk
                steps = search(wide, config.level, meter)
                found = yield from _on_line(steps, line, vertical, last)
                around = None
                if config.sharp:
                    found, around = yield from _on_line(settle(found, meter), line, vertical, last)
                edges.add(line, vertical, found, around)
            left = sample
            above[index] = sample
    return edges


def _walk(crossing: Crossing, threshold: int, meter: Meter) -> Generator[int, int, Crossing]:
    """Step from the dark end to the first bright pixel."""
    step = 1 if crossing.bright > crossing.dark else -1
    dark, dark_value = crossing.dark, crossing.dark_value
    meter.charge(call=1)
    for position in range(crossing.dark + step, crossing.bright, step):
        value = yield position
        meter.charge(i8=4, loop=1)
        if value >= threshold:
            return Crossing(position, dark, value, dark_value)
        dark, dark_value = position, value
    return Crossing(crossing.bright, dark, crossing.bright_value, dark_value)


def _on_line(
    steps: Generator[int, int, Answer], line: int, vertical: bool, last: int
) -> Generator[Pixel, int, Answer]:
    """Request the pixels at positions of ``steps`` on a line, clamped to 0 to ``last``."""
    try:
        position = next(steps)
        while True:
            position = min(max(position, 0), last)
            value = yield (line, position) if vertical else (position, line)
            position = steps.send(value)
    except StopIteration as end:
        found: Answer = end.value
        return found
