"""Each FPGA's actions are left in everything that they can be at; irregular cameras, each path."""

import random
from collections.abc import Sequence
from itertools import product

from cocotb.triggers import Timer

from cubestack.firmware_model.interface.cubesense.fpga import ADDRESSING_COMMANDS, COMMANDS, Action
from cubestack.hdl.contract.bench.camera import flat, line, lines, picture
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.testbench import checked_test
from tests.hdl.coverage.cubesense import TOP
from tests.hdl.coverage.points import GROUPS
from tests.hdl.cubesense.pair import OTHER, PairTestbench, frame, gap
from tests.hdl.cubesense.reference import MCU_ADDRESSING, READ_OUT

COLUMNS, ROWS, GAP = READ_OUT.columns, READ_OUT.rows, READ_OUT.frame_gap
ROWS_OF_TABLE = COMMANDS[1:] + ADDRESSING_COMMANDS * MCU_ADDRESSING
STAND = {"SUNEN": 1, "NADEN": 1}

#: Irregular pictures that are not acknowledged by themselves.
ENDS_WITHOUT_ACK = ("last row too short", "frame too short")

PAUSE, PIXEL = Tick(9, 0, 1), Tick(9, 1, 1)


def ticks_to(state: str) -> tuple[list[Tick], list[Tick]]:
    row = [tick for tick in line(picture()[:COLUMNS]) if tick.hsync]
    before = [*gap(), *flat(lines(picture())[: random.randrange(ROWS - 1)])]
    cut = random.randrange(1, COLUMNS)
    stay = (GAP - 2) // 2
    return {
        "in a line": ([*before, *row[: cut - 1]], row[cut - 1 :]),
        "write pulse": ([*before, *row[: cut - 1]], row[cut - 1 :]),
        "surplus pixels": ([*before, *row], [PIXEL] * 40),
        "between lines": ([*before, *row], [PAUSE] * stay),
        "between frames": ([*gap(), *row, *[PAUSE] * (GAP + 2)], [PAUSE] * 40),
        "short last row": (frame(picture()[:-cut]), [PAUSE] * stay),
        "ACK": ([*frame(picture()), PAUSE], [PAUSE] * 40),
    }[state]


def row_with(side: str, action: Action) -> Sequence[int]:
    """Levels of a row of the table in which an FPGA does that; the other may do anything."""
    row = random.choice([row for row in ROWS_OF_TABLE if getattr(row.actions, side) is action])
    return tuple(level or 0 for level in row.levels)


async def leave_store(bench: PairTestbench, side: str, action: Action, state: str) -> None:
    camera = bench.cameras[side if action is Action.STORE else OTHER[side]]
    await bench.mcu.command(*row_with(side, action))
    if state != "reset":
        await camera.started()
        held = state in ("in a line", "write pulse")
        await camera.hold(*ticks_to(state), exactly=held, low=state == "write pulse")
    await bench.mcu.set(random.randrange(1, camera.period // 8), **STAND)


async def leave_sending(bench: PairTestbench, side: str, state: str) -> None:
    camera = bench.cameras[side]
    await bench.mcu.command(*row_with(side, Action.SEND_PICTURE))
    stay = [PIXEL if state.startswith("line") else PAUSE] * 20
    await camera.hold(stay[:2], [*stay, *stay], exactly=False, low=state.endswith("low"))
    await bench.mcu.set(random.randrange(1, camera.period // 8), **STAND)


def clocks_to(state: str, window: bool) -> int:
    rows, clocks = 1 + len(READ_OUT.scan_rows) * COLUMNS, READ_OUT.scan_clocks
    after, pixels = 4 + READ_OUT.window**2, GEOMETRY.pixels
    scan = {"A": range(1, rows), "B": range(rows, rows + 1), "C": range(rows + 1, clocks)}
    ranges = {
        **({name: range(n, n + 1) for n, name in enumerate("ABCD")} if window else scan),
        "default": range(1),
        "C again": range(clocks, clocks + 9),
        "E": range(4, after),
        "E again": range(after, after + 9),
        "first row": range(1, COLUMNS),
        "further rows": range(COLUMNS, pixels),
        "last pixel": range(pixels, pixels + 1),
        "wrapped": range(pixels + 1, pixels + 9),
        "next bytes": range(2, 9),
        "passing": range(9),
        "more bytes": range(4, 9),
        **dict.fromkeys(("no clock", "no byte"), range(1)),
        **dict.fromkeys(("addressed byte", "one byte"), range(1, 2)),
        **{"two bytes": range(2, 3), "address": range(3, 4)},
    }
    return random.choice(ranges[state])


async def leave_reading(bench: PairTestbench, side: str, action: Action, state: str) -> None:
    mcu = bench.mcu
    of_sun = (side == "sun") == (action is Action.EDGE)
    await mcu.command(*row_with(side, action))
    for _ in range(clocks_to(state, of_sun)):
        if action is Action.TAKE_ADDRESS:
            mcu.drive(random.getrandbits(8))
        await mcu.clock()
    if action is Action.TAKE_ADDRESS:
        mcu.drive(None)
    await mcu.set(**STAND)


@checked_test(PairTestbench)
async def every_action_is_left_in_every_state(bench: PairTestbench) -> None:
    await bench.shoot(("sun", "sun"), picture())
    await bench.shoot(("sun", "nadir"), picture())
    wanted = [point[1:] for point in GROUPS["pair state"].points() if point[0] == TOP]
    for side, name, state in random.sample(wanted, len(wanted)):
        action = Action[name.removeprefix("Action.")]
        if action in (Action.STORE, Action.STORE_OTHER):
            await leave_store(bench, side, action, state)
        elif action is Action.SEND_PICTURE:
            await leave_sending(bench, side, state)
        else:
            await leave_reading(bench, side, action, state)
        await Timer(1, unit="us")
        await bench.cameras_are_done()
    for place in bench.PLACES:
        await bench.shoot(place)


@checked_test(PairTestbench)
async def every_row_in_every_order_of_the_enables(bench: PairTestbench) -> None:
    for shift, edge, rnw, *levels in random.sample(list(product((0, 1), repeat=5)), 32):
        names = [name for name, level in zip(STAND, levels, strict=True) if not level]
        for order in [[name] for name in names], [names], [[name] for name in names[::-1]]:
            await bench.mcu.set(SHIFT=shift, EDGE=edge, RNW=rnw)
            for group in order:
                await bench.mcu.set(**dict.fromkeys(group, 0))
            await bench.mcu.set(**STAND)
    await bench.shoot(("sun", "nadir"), picture())


def irregular(case: str) -> list[Tick]:
    rows = lines(picture())
    number = random.randrange(ROWS - 2)
    match case:
        case "line too long":
            rows[number] = list(line(random.randbytes(COLUMNS + random.choice([1, 2, COLUMNS]))))
        case "line too short":
            rows[number] = list(line(random.randbytes(random.choice([1, COLUMNS - 1]))))
        case "last row too short":
            rows[-1] = list(line(random.randbytes(random.randrange(1, COLUMNS))))
        case "frame too short":
            del rows[number]
    return [*gap(), *flat(rows)]


@checked_test(PairTestbench)
async def irregular_cameras_on_every_path(bench: PairTestbench) -> None:
    """Left before ACK, and once more when it came, with a regular picture after it."""
    cases = GROUPS["pair border"].points()
    for camera, memory, case, acknowledged in random.sample(cases, len(cases)):
        source, place = bench.cameras[camera], (camera, memory)
        content = irregular(case)
        if case.startswith("joined"):
            # In the middle of a line that is long enough, or of the pause before one.
            there = [PIXEL if case == "joined in a line" else PAUSE] * 60
            start = await source.begin([*there, *line(picture()[:COLUMNS])])
            await source.reach(start + 1)
            await bench.mcu.set(1, SHIFT=0)
        await bench.command(place)
        await source.reach(len(source.clocks) + 4)
        if acknowledged == "no":
            # Not as far as its last pixel.
            source.send(content if case in ENDS_WITHOUT_ACK else content[: -COLUMNS - 9])
            source.send([*gap(), *line(picture()[:1])])
        else:
            source.send([*content, *frame(picture()), *frame(picture())])
            assert await bench.acknowledged(place)
        await source.sent()
        await bench.mcu.set(**STAND)
