"""Each store of CubeStar's is left in everything that it can be at, by each pin that may end it."""

import random

from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import flat, frame, line, lines, picture, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.testbench import checked_test
from tests.hdl.coverage.points import GROUPS
from tests.hdl.cubestar.board import CubeStarTestbench
from tests.hdl.harness.any_top import TESTBENCH, works

COLUMNS, ROWS = GEOMETRY

#: What ends a store: levels of ENABLE and RNW.
PINS = {"ENABLE": {"ENABLE": 0}, "RNW": {"RNW": 1}, "both": {"ENABLE": 0, "RNW": 1}}

PAUSE, GAP, PIXEL = Tick(9, 0, 1), Tick(9, 0, 0), Tick(9, 1, 1)
LONG = 40  # clocks for which a state is held


def ticks_to(state: str) -> tuple[list[Tick], list[Tick]]:
    gap, row = list(vsync()), list(line(picture()[:COLUMNS]))
    before = [*gap, *flat(lines(picture())[: random.randrange(ROWS - 1)])]
    cut = random.randrange(1, COLUMNS)
    return {
        "before a line": (gap, [PAUSE] * LONG),
        "in a line": ([*before, *row[: cut - 1]], row[cut - 1 :]),
        "write pulse": ([*before, *row[: cut - 1]], row[cut - 1 :]),
        "surplus pixels": ([*before, *row[:COLUMNS]], [PIXEL] * LONG),
        "between lines": ([*before, *row], [PAUSE] * LONG),
        "between frames": (before, [GAP] * LONG),
        "short last row": (frame(picture()[:-cut]), [PAUSE] * LONG),
        "ACK": ([*frame(picture()), GAP], [PAUSE] * LONG),
    }[state]


async def leave(bench: CubeStarTestbench, place: int, state: str, pins: dict[str, int]) -> None:
    await bench.command(place)
    if state != "reset":
        await bench.camera.started()
        held = state in ("in a line", "write pulse")
        await bench.camera.hold(*ticks_to(state), exactly=held, low=state == "write pulse")
    await bench.control(place).set(random.randrange(1, bench.camera.period // 8), **pins)


@checked_test(TESTBENCH)
async def left_in_every_state_by_every_pin(bench: TESTBENCH) -> None:
    wanted = [point[1:] for point in GROUPS["cubestar store"].points() if point[0] == TESTBENCH.TOP]
    for state, left_by in random.sample(wanted, len(wanted)):
        place = random.choice(TESTBENCH.PLACES)
        await leave(bench, place, state, PINS[left_by])
        await Timer(1, unit="us")
        await bench.standby()
        await bench.camera.sent()
        if random.random() < 0.3:
            await works(bench, place)
    await works(bench, random.choice(TESTBENCH.PLACES))
