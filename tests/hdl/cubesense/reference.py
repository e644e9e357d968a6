"""What the pair of FPGAs has to do, worked out afterwards from what its pins did.

Follows the command table and the wording of the blocks' docstrings; whole frames and whole
read-outs at once, not clock by clock.
"""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, cycle, groupby, islice, pairwise, product
from typing import NamedTuple

from cubestack.firmware_model.interface.cubesense import fpga
from cubestack.firmware_model.interface.cubesense.fpga import SUN_RUN, SUN_THRESHOLD, Action
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Clock, Pulse, Tick
from tests.hdl.harness.reference import taken, write

#: Settings of the simulation that imports this, from its environment.
READ_OUT = fpga.ReadOut(**json.loads(os.environ["READ_OUT"]))

#: Whether the design has address control from the microcontroller.
MCU_ADDRESSING = os.environ.get("MCU_ADDRESSING") == "1"

SIDES = ("sun", "nadir")
NEVER = 1 << 62
ADDRESSING = (Action.TAKE_ADDRESS, Action.READ_FROM)
NOT_FOUND = tuple((1 << (size - 1).bit_length()) - 1 for size in GEOMETRY)


class Controls(NamedTuple):
    """Levels that the microcontroller drives, from ``time`` (ps) on."""

    time: int
    shift: int
    edge: int
    rnw: int
    sunen: int
    naden: int


class Window(NamedTuple):
    """Time in ps for which an FPGA takes an action."""

    start: int
    end: int
    action: Action


@dataclass
class Half:
    memory: bytearray
    windows: list[Window]
    pulses: list[Pulse] = field(default_factory=list)
    ack: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0)])
    sun: tuple[int, int] | None = None  # first Sun pixel; None before the first Sun picture
    suns_read: list[tuple[int, int]] = field(default_factory=list)  # of each window read


def vsync(href: Sequence[int]) -> list[int]:
    """At each clock since reset: 1 in a frame, up to the clock that makes a pause a gap."""
    levels: list[int] = []
    started = 0
    for level, run in groupby(href):
        count = len(list(run))
        if level or count <= READ_OUT.frame_gap:
            levels += [started] * count
        else:
            levels += [started] * READ_OUT.frame_gap + [0] * (count - READ_OUT.frame_gap)
            started = 1
    return levels


def action_of(side: str, controls: Controls) -> Action:
    """Actions of an FPGA that sees its own enable, and the other one only over the link."""
    _, shift, edge, rnw, sunen, naden = controls
    if not fpga.link_shows_enables(shift, edge):
        sunen, naden = (sunen, 0) if side == "sun" else (0, naden)
    levels = (shift, edge, rnw, sunen, naden)
    return getattr(fpga.actions(*levels, mcu_addressing=MCU_ADDRESSING), side)


def windows(side: str, controls: Sequence[Controls]) -> list[Window]:
    """All times of an action other than standby; ``controls`` ends in standby."""
    found: list[Window] = []
    steps = [(c.time, action_of(side, c)) for c in controls]
    for action, run in groupby(enumerate(steps), key=lambda step: step[1][1]):
        indices = [index for index, _ in run]
        if action is not Action.STANDBY:
            found.append(Window(steps[indices[0]][0], steps[indices[-1] + 1][0], action))
    return found


def link_clocks(sending: Sequence[Window], camera: Sequence[Clock]) -> list[Clock]:
    """Periods of the link's clock line: pulled up, or a copy of the sender's PCLK.

    When the sender lets go of a low line there is one more rising edge, with HREF pulled up and no
    data.
    """
    levels: list[tuple[int, int, Tick]] = [(0, 1, Tick(0, 1, 1))]
    for window in sending:
        before = [clock for clock in camera if clock.rise < window.start]
        high = bool(before) and before[-1].fall > window.start
        levels.append((window.start, int(high), Tick(0, 1, 1)))
        if high and before[-1].fall < window.end:
            levels.append((before[-1].fall, 0, Tick(0, 1, 1)))
        for clock in camera:
            if window.start < clock.rise < window.end:
                levels.append((clock.rise, 1, clock.pins))
                if clock.fall < window.end:
                    levels.append((clock.fall, 0, clock.pins))
        levels.append((window.end, 1, Tick(0, 1, 1)))
    edges = [now for before, now in pairwise(levels) if before[1] != now[1]]
    falls = [time for time, level, _ in edges if not level]
    return [
        Clock(time, next((fall for fall in falls if fall > time), NEVER), pins)
        for time, level, pins in edges
        if level
    ]


def store(half: Half, window: Window, clocks: Sequence[Clock], of_sun: bool) -> None:
    clocks = [clock for clock in clocks if window.start < clock.rise < window.end]
    clocks = clocks[2:]  # the reset is released through two flip-flops
    levels = vsync([clock.pins.hsync for clock in clocks])
    ticks = [c.pins._replace(vsync=level) for c, level in zip(clocks, levels, strict=True)]
    pixels, ack = found = taken(ticks, GEOMETRY)
    write(half, clocks, window.end, found)
    if of_sun and len(clocks) >= 2:
        half.sun = first_sun(ticks[: ack + 1 if ack else None], pixels)


def first_sun(ticks: Sequence[Tick], pixels: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """First of three bright ones side by side in the last frame that began."""
    began = max(index for index, tick in enumerate(ticks) if not tick.vsync)
    columns = GEOMETRY.address(0, 1)
    later = [(index, address) for index, address in pixels if index > began]
    bright = [(index, address) for index, address in later if ticks[index].pixel >= SUN_THRESHOLD]
    for first, third in zip(bright, bright[SUN_RUN - 1 :], strict=False):
        together = third[1] - first[1] == SUN_RUN - 1 and third[0] - first[0] == SUN_RUN - 1
        if together and third[0] + 1 < len(ticks):
            return first[1] % columns, first[1] // columns
    return NOT_FOUND


def picture(half: Half) -> Iterator[int]:
    for address in cycle(GEOMETRY.addresses()):
        yield half.memory[address]


def scan(half: Half) -> Iterator[int]:
    pixels = list(READ_OUT.scan())
    vertical = pixels[-len(READ_OUT.scan_columns) * READ_OUT.rows :]
    for pixel in chain(pixels, cycle(vertical)):
        yield half.memory[0 if pixel is None else GEOMETRY.address(*pixel)]


def sun_window(half: Half) -> Iterator[int]:
    assert half.sun is not None, "a window is read before a Sun picture was stored"
    x, y = half.sun
    half.suns_read.append(half.sun)
    yield from x.to_bytes(2, "little") + y.to_bytes(2, "little")
    left, top = READ_OUT.window_origin(x, y)
    for row, column in cycle(product(range(READ_OUT.window), repeat=2)):
        yield half.memory[GEOMETRY.address(left + column, top + row)]


def addressed(
    half: Half, start: Window, data_clocks: Sequence[int], sent: Mapping[int, int]
) -> dict[int, int]:
    """Bytes from when ``start`` takes an address for the first time until another action follows.

    ``sent`` is what the microcontroller drives, by the time of its clock.
    """
    address, end = 0, start.start
    data: dict[int, int] = {}
    for window in half.windows[half.windows.index(start) :]:
        if window.action not in ADDRESSING or window.start != end:
            break
        end = window.end
        for time in data_clocks:
            if window.start < time < end and window.action is Action.TAKE_ADDRESS:
                address = (address << 8 | sent[time]) % GEOMETRY.bank_size
            elif window.start < time < end:
                data[time] = half.memory[address]
                y, x = divmod(address, GEOMETRY.address(0, 1))
                address = GEOMETRY.addresses()[(y * GEOMETRY.columns + x + 1) % GEOMETRY.pixels]
    return data


def read(half: Half, side: str, window: Window, data_clocks: Sequence[int]) -> dict[int, int]:
    """Byte on the microcontroller's bus after each data clock of one read-out."""
    order = scan
    if window.action is Action.READ:
        order = picture
    elif (side == "sun") == (window.action is Action.EDGE):
        order = sun_window
    times = [time for time in data_clocks if window.start < time < window.end]
    return dict(zip(times, islice(order(half), len(times)), strict=True))


def behaviour(
    memories: Sequence[bytes],
    cameras: Sequence[Sequence[Clock]],
    controls: Sequence[Controls],
    data_clocks: Sequence[int],
    sent: Mapping[int, int],
) -> tuple[dict[str, Half], dict[int, int]]:
    """Both halves, and the bytes read, from the memories at first and what the inputs did since."""
    both = [Half(bytearray(m), windows(s, controls)) for s, m in zip(SIDES, memories, strict=True)]
    data: dict[int, int] = {}
    for own, (side, half) in enumerate(zip(SIDES, both, strict=True)):
        sending = [w for w in both[1 - own].windows if w.action is Action.SEND_PICTURE]
        link = link_clocks(sending, cameras[1 - own])
        ended, before = -1, Action.STANDBY
        for window in half.windows:
            if window.action is Action.STORE:
                store(half, window, cameras[own], side == "sun")
            elif window.action is Action.STORE_OTHER:
                store(half, window, link, side == "nadir")
            elif window.action in (Action.READ, Action.EDGE, Action.SEND_EDGE):
                data |= read(half, side, window, data_clocks)
            elif window.action in ADDRESSING and not (
                before in ADDRESSING and ended == window.start
            ):
                data |= addressed(half, window, data_clocks, sent)
            ended, before = window.end, window.action
    return dict(zip(SIDES, both, strict=True)), data
