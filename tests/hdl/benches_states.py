"""Each store is left in everything that it can be at, by each pin that may end it.

``BENCH`` in the environment names the bench, one of CubeStar's.
"""

import random
from typing import Any

from bench import flat, frame, line, lines, picture, timed_test, vsync
from benches_any_top import BENCH, works
from cocotb.triggers import FallingEdge, Timer
from cover_points import GROUPS
from geometry import GEOMETRY
from reference import Tick

COLUMNS, ROWS = GEOMETRY

TOP = {
    "Bench": "published",
    "SharedBench": "shared",
    "DoubleBench": "double",
    "BoardsBench": "boards",
}[BENCH.__name__]

#: What ends a store: levels of ENABLE and RNW.
PINS = {"ENABLE": {"ENABLE": 0}, "RNW": {"RNW": 1}, "both": {"ENABLE": 0, "RNW": 1}}

PAUSE, GAP, PIXEL = Tick(9, 0, 1), Tick(9, 0, 0), Tick(9, 1, 1)
LONG = 40  # clocks for which a state is held


def ticks_to(state: str) -> tuple[list[Tick], list[Tick]]:
    """What a camera sends to get there, and to stay for a while."""
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


async def leave(bench: Any, place: int, state: str, pins: dict[str, int]) -> None:
    """From standby to there, and out."""
    await bench.command(place)
    camera = bench.camera
    if state != "reset":
        await camera.reach(len(camera.clocks) + 3)
        there, stay = ticks_to(state)
        start = await camera.begin([*there, *stay])
        first = start + len(there) + 1
        held = state in ("in a line", "write pulse")
        await camera.reach(first if held else first + random.randrange(LONG // 2))
        if state == "write pulse":
            await FallingEdge(bench.dut.PIXCLK)
    await bench.control(place).set(random.randrange(1, camera.period // 8), **pins)
    if hasattr(bench, "into"):
        bench.into = None


@timed_test
async def left_in_every_state_by_every_pin(dut: Any) -> None:
    bench = await BENCH.start(dut)
    wanted = [point[1:] for point in GROUPS["cubestar store"].points() if point[0] == TOP]
    for state, left_by in random.sample(wanted, len(wanted)):
        place = random.choice(BENCH.PLACES)
        await leave(bench, place, state, PINS[left_by])
        await Timer(1, unit="us")
        await bench.standby()
        await bench.camera.sent()
        if random.random() < 0.3:
            await works(bench, place)
    await works(bench, random.choice(BENCH.PLACES))
    await bench.check()
