"""What the frame buffer has to do, worked out afterwards from what the pins did.

Follows the wording of FrameWriter's, FrameReader's and CubeStarTop's docstrings; whole lines and
whole frames at once, not clock by clock, so that it shares no structure with the design.
"""

from collections.abc import Sequence
from itertools import cycle, groupby, pairwise
from typing import Any, NamedTuple

from cubestack.hdl.contract.bench.geometry import Clock, Geometry, Pulse, Tick
from cubestack.hdl.contract.cubestar.board import Controls


class Window(NamedTuple):
    """Time in ps for which the board stores (``rnw`` = 0) or is read (``rnw`` = 1)."""

    start: int
    end: int
    rnw: int
    bank: int


class Behaviour(NamedTuple):
    """What is expected: write pulses, and (time in ps, new value) of ACK and of DATA."""

    pulses: list[Pulse]
    ack: list[tuple[int, int]]
    data: list[tuple[int, int]]
    memory: bytearray


#: Pixels to store, as (index into the ticks, address in the bank), and the tick of ACK.
Taken = tuple[list[tuple[int, int]], int | None]


def taken(ticks: Sequence[Tick], geometry: Geometry) -> Taken:
    pixels: list[tuple[int, int]] = []
    for vsync, frame in groupby(enumerate(ticks), key=lambda item: item[1].vsync):
        if not vsync:
            continue
        runs = [list(run) for hsync, run in groupby(frame, key=lambda i: i[1].hsync) if hsync]
        lines = [[index for index, _ in run] for run in runs]
        lines = [line for line in lines if line[0] > 0 and not ticks[line[0] - 1].hsync]
        for row, line in enumerate(lines[: geometry.rows]):
            pixels += [
                (index, geometry.address(column, row))
                for column, index in enumerate(line[: geometry.columns])
            ]
        if len(lines) >= geometry.rows and len(lines[geometry.rows - 1]) >= geometry.columns:
            return pixels, pixels[-1][0] + 1
    return pixels, None


def windows(controls: Sequence[Controls]) -> list[Window]:
    """Storing and reading times; ``controls`` begins and ends in standby."""
    found = []
    start = bank = 0
    for before, now in pairwise(controls):
        if (now.enable, now.rnw) != (before.enable, before.rnw):
            if before.enable:
                found.append(Window(start, now.time, before.rnw, bank))
            elif now.enable:
                bank = now.bank
            start = now.time
    return found


def behaviour(
    geometry: Geometry,
    memory: bytes,
    camera: Sequence[Clock],
    controls: Sequence[Controls],
    data_clocks: Sequence[int],
) -> Behaviour:
    """Work out everything from the initial ``memory`` and what the inputs did since."""
    done = Behaviour([], [(0, 0)], [(0, 0)], bytearray(memory))
    for window in windows(controls):
        start, end, rnw, _ = window
        if rnw:
            _read(done, geometry, window, [t for t in data_clocks if start < t < end])
        else:
            _store(done, geometry, window, [c for c in camera if start < c.rise < end])
    return done


def _store(done: Behaviour, geometry: Geometry, window: Window, clocks: list[Clock]) -> None:
    clocks = clocks[2:]  # the reset is released through two flip-flops
    found = taken([clock.pins for clock in clocks], geometry)
    write(done, clocks, window.end, found, window.bank * geometry.bank_size)


def write(done: Any, clocks: Sequence[Clock], end: int, found: Taken, base: int = 0) -> None:
    """The pulses, memory and ACK of what was taken at ``clocks``, cut off at ``end``."""
    pixels, ack = found
    ends = [clock.rise for clock in clocks[1:]] + [end]
    for index, position in pixels:
        _, fall, pins = clocks[index]
        if fall < end:
            done.pulses.append(Pulse(fall, ends[index], base + position, pins.pixel))
            done.memory[base + position] = pins.pixel
    if ack is not None and ack < len(clocks):
        done.ack.extend([(clocks[ack].rise, 1), (end, 0)])


def _read(done: Behaviour, geometry: Geometry, window: Window, data_clocks: list[int]) -> None:
    content = cycle([done.memory[address] for address in geometry.addresses(window.bank)])
    for time, value in [*zip(data_clocks, content, strict=False), (window.end, 0)]:
        if value != done.data[-1][1]:
            done.data.append((time, value))
