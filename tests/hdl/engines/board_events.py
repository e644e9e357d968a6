"""Random activity on every input of a board: whole frames, and a microcontroller at work.

Every event is an instant of its own, so that what each engine settles on is defined.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar import wiring as cubestar
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.wiring import CameraPins, Wiring
from cubestack.firmware_model.interface.cubesense import fpga
from cubestack.firmware_model.interface.cubesense.fpga import Action
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.board import CubeStarBoard
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared, CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop
from tests.hdl.regression import SMALLEST

SPACING_PS = 10  #: Between two events at least; a bench in Verilog needs some of it to settle

#: Of CubeStar's tops: so wide that the bus' address latch has bits; no power of two.
COLUMNS, ROWS = 18, 5

ADDRESS_BITS = 10  #: One more than the memories on the bus have

Step = tuple[int, str, int]  #: Wait in ps, then the pin to drive and its level
Rng = np.random.Generator
Script = Callable[[Rng], Iterator[Step]]


@dataclass(frozen=True)
class Board:
    wiring: Callable[[bool], Wiring]  # of the top, on request one column narrower
    columns: int
    rows: int
    gap: int  # clocks between two frames at least
    script: Script  # what the microcontroller does next, for ever


def random_events(board: Board, wiring: Wiring, rng: Rng, end_ps: int) -> list[PinEvent]:
    """Cameras with clocks of their own, and the microcontroller, up to ``end_ps``."""
    sources = [_camera(board, camera, rng) for camera in wiring.cameras] + [board.script(rng)]
    merged = [event for source in sources for event in _until(source, end_ps)]
    events, time_ps = [], 0
    for at, pin, level in sorted(merged, key=lambda event: event[0]):
        time_ps = max(at, time_ps + SPACING_PS)
        events.append(PinEvent(time_ps, pin, level))
    return events


def _until(steps: Iterator[Step], end_ps: int) -> Iterator[tuple[int, str, int]]:
    time_ps = 0
    for wait, pin, level in steps:
        time_ps += wait
        if time_ps > end_ps:
            return
        yield time_ps, pin, level


def _camera(board: Board, pins: CameraPins, rng: Rng) -> Iterator[Step]:
    """Frames of all kinds; now and then a line pin moves in the high half of the clock, too."""
    half_ps = int(rng.integers(20_000, 60_000))
    while True:
        line_clocks = board.columns + int(rng.integers(1, board.gap))
        rows = board.rows if rng.random() < 0.85 else int(rng.integers(1, 2 * board.rows))
        columns = board.columns if rng.random() < 0.85 else board.columns + int(rng.choice([-1, 2]))
        blank = board.gap + 3 if rng.random() < 0.9 else int(rng.integers(1, board.gap))
        for clock in range(-blank, rows * line_clocks):
            row, column = divmod(clock, line_clocks)
            inside = row >= 0 and column < columns
            if pins.frame is not None:
                low = row < 0 and blank > 4
                yield 0, pins.frame, int(not low if rng.random() < 0.998 else low)
            yield 0, pins.line, int(inside)
            if inside:
                bright = rng.random() < 0.4
                yield 0, pins.data, int(rng.integers(200, 256) if bright else rng.integers(0, 200))
            yield half_ps, pins.clock, 1
            if rng.random() < 0.005:
                yield half_ps // 3, pins.line, int(rng.integers(2))
            yield half_ps, pins.clock, 0


def _pause(rng: Rng) -> int:
    return int(np.exp(rng.uniform(np.log(1_000), np.log(14_000_000))))


def _cubestar(rng: Rng) -> Iterator[Step]:
    """Stores, reads at any rate, standby; any of the four pins at any moment besides."""
    while True:
        yield _pause(rng), "ENABLE", 0
        yield int(rng.integers(1_000, 50_000)), "BANK", int(rng.integers(2))
        reads = int(rng.random() < 0.4)
        yield 1_000, "RNW", reads
        yield 1_000, "ENABLE", 1
        if reads:
            half_ps = int(rng.integers(4_000, 100_000))
            for _ in range(int(rng.integers(1, 60))):
                yield half_ps, "DCLK", 1
                yield half_ps, "DCLK", 0
        else:
            yield int(rng.integers(5_000_000, 35_000_000)), "BANK", int(rng.integers(2))
        if rng.random() < 0.3:
            pin = str(rng.choice(["RNW", "BANK", "DCLK"]))
            yield _pause(rng), pin, 1
            yield _pause(rng), pin, 0


def _access(rng: Rng, select: str) -> Iterator[Step]:
    """A read or a write of the external bus; now and then with a line that moves too early."""
    address = int(rng.integers(0, 1 << ADDRESS_BITS))
    wait = int(rng.integers(2_000, 40_000))
    strobe = str(rng.choice(["RE_N", "WE_N"]))
    yield wait, "AD_HIGH", address >> 16 & 0xFF
    yield 100, "AD_LOW_I", address >> 8 & 0xFF
    yield 100, "ALE", 1
    yield wait, "ALE", 0
    yield wait, "AD_HIGH", address & 0xFF
    yield 100, "AD_LOW_I", int(rng.integers(256))
    yield 100, select, 0
    yield wait, strobe, 0
    if rng.random() < 0.1:
        pin = str(rng.choice(["AD_HIGH", "AD_LOW_I"]))
        yield wait, pin, int(rng.integers(256))
    yield wait, strobe, 1
    if rng.random() < 0.9:
        yield wait, select, 1


def _on_bus(boards: tuple[str, ...] = ("",), choice: str = "BANK") -> Script:
    """Stores, accesses at any time, standby; ``choice`` is the pin that says where to store."""

    def script(rng: Rng) -> Iterator[Step]:
        for pin in ("RE_N", "WE_N", *(f"{board}CS_N" for board in boards)):
            yield 100, pin, 1
        while True:
            board = str(rng.choice(boards))
            match rng.choice(["store", "bus", "mode", "choose"], p=[0.3, 0.45, 0.15, 0.1]):
                case "store":
                    for pin, level in (("ENABLE", 0), ("RNW", 1), ("RNW", 0), ("ENABLE", 1)):
                        yield int(rng.integers(500, 5_000)), f"{board}{pin}", level
                    yield int(rng.integers(5_000_000, 30_000_000)), "ALE", 0
                case "bus":
                    for pin, level in (("RNW", 1), ("ENABLE", 1)):
                        yield 500, f"{board}{pin}", level
                    for _ in range(int(rng.integers(1, 12))):
                        yield from _access(rng, f"{rng.choice(boards)}CS_N")
                case "mode":
                    pin = str(rng.choice(["ENABLE", "RNW"]))
                    yield _pause(rng), f"{board}{pin}", int(rng.integers(2))
                case _:
                    yield 500, f"{board}{choice}", int(rng.integers(2))

    return script


def _cubesense(mcu_addressing: bool) -> Script:
    enables = ("SUNEN", "NADEN")
    commands = fpga.COMMANDS + fpga.ADDRESSING_COMMANDS * mcu_addressing
    storing = [row for row in commands if {Action.STORE, Action.STORE_OTHER} & {*row.actions}]
    reading = [row for row in commands if row not in storing]

    def script(rng: Rng) -> Iterator[Step]:
        receiver = 0
        while True:
            # A linked store's receiver first: the sender's clock makes an edge as it goes.
            for pin in (enables[receiver], enables[1 - receiver]):
                yield int(rng.integers(1_000, 30_000)), pin, 1
            stores = rng.random() < 0.5
            rows = storing if stores else reading
            row = rows[rng.integers(len(rows))]
            receiver = 0 if row.shift and row.rnw else 1
            levels = (("SHIFT", row.shift), ("EDGE", row.edge), ("RNW", row.rnw))
            for pin, level in (*levels, ("SUNEN", row.sunen), ("NADEN", row.naden)):
                value = int(rng.integers(2)) if level is None else int(level)
                yield int(rng.integers(1_000, 30_000)), pin, value
            if stores:
                yield int(rng.integers(5_000_000, 25_000_000)), "CLK", 0
                continue
            taking = row in fpga.ADDRESSING_COMMANDS and not row.shift
            for _ in range(int(rng.integers(1, 5 if taking else 60))):
                if mcu_addressing and (taking or rng.random() < 0.02):
                    yield 1_000, "DATA_I", int(rng.integers(256))
                yield int(rng.integers(30_000, 80_000)), "CLK", 1
                yield int(rng.integers(30_000, 80_000)), "CLK", 0
            if taking:
                # On with what was addressed, without standby.
                yield 20_000, "SHIFT", 1
                for _ in range(int(rng.integers(1, 20))):
                    yield 50_000, "CLK", 1
                    yield 50_000, "CLK", 0

    return script


def _pair(mcu_addressing: bool) -> Board:
    @cache
    def wiring(narrow: bool) -> Wiring:
        columns = SMALLEST.columns - narrow
        return cubesense_wiring(CubeSensePair(replace(SMALLEST, columns=columns), mcu_addressing))

    size = (SMALLEST.columns, SMALLEST.rows, SMALLEST.frame_gap)
    return Board(wiring, *size, _cubesense(mcu_addressing))


def _star(make: Callable[[Any], Wiring], top: type[CubeStarBoard], script: Script) -> Board:
    return Board(cache(lambda narrow: make(top(COLUMNS - narrow, ROWS))), COLUMNS, ROWS, 9, script)


#: By the top's name, as the command line has it.
BOARDS = {
    "cubestar": _star(cubestar.cubestar_wiring, CubeStarTop, _cubestar),
    "cubestar-shared": _star(cubestar.cubestar_shared_wiring, CubeStarShared, _on_bus()),
    "cubestar-double": _star(
        cubestar.cubestar_double_wiring, CubeStarDouble, _on_bus(choice="INTO")
    ),
    "cubestar-boards": _star(
        cubestar.cubestar_two_boards_wiring, CubeStarTwoBoards, _on_bus(("BOARD1_", "BOARD2_"))
    ),
    "cubesense-pair": _pair(mcu_addressing=False),
    "cubesense-pair-addressing": _pair(mcu_addressing=True),
}
