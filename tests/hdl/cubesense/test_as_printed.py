"""The gateware as printed, block by block, against appendices D.3 and D.4 gone through by hand."""

from collections.abc import Iterable
from itertools import islice
from typing import Any

import pytest
from amaranth.lib.wiring import Component
from amaranth.sim import Simulator

from cubestack.firmware_model.interface.cubesense.fpga import READ_OUTS, ReadOut
from cubestack.hdl.cubesense.nadir_scan import NadirScan
from cubestack.hdl.cubesense.sun_search import SunSearch
from cubestack.hdl.cubesense.sun_window import SunWindow

FULL = READ_OUTS["both-searches"]
SMALL = ReadOut(
    21,
    13,
    2,
    scan_step=4,
    first_row=1,
    first_column=3,
    window=5,
    window_left=2,
    window_above=1,
    as_printed=True,
)
DARK, LIT = 199, 200


def simulated(
    block: Component, domain: str, clocks: Iterable[dict[str, int]], *outputs: str
) -> list[tuple[int, ...]]:
    """Outputs after each clock, at which the inputs are as given; "reset" is one of them."""
    seen = []
    simulator = Simulator(block)
    simulator.add_clock(1e-6, domain=domain)

    async def run(ctx: Any) -> None:
        for pins in clocks:
            for name, level in pins.items():
                ctx.set(getattr(block, name), level)
            await ctx.tick(domain)
            seen.append(tuple(ctx.get(getattr(block, name)) for name in outputs))

    simulator.add_testbench(run)
    simulator.run()
    return seen


def scan_by_hand(size: ReadOut) -> list[tuple[int, int] | None]:
    """Pixel at each clock: the address that the clock before has put out."""
    pixels: list[tuple[int, int] | None] = []
    shown, state = None, "A"
    column, row = 1, size.first_row
    for _ in range(size.scan_clocks):
        pixels.append(shown)
        if state == "B":
            state = "C"
            continue
        shown = column, row
        if state == "C":
            row += 1
            if row == size.rows:
                row, column = 0, column + size.scan_step
        elif column < size.columns - 1:
            column += 1
        elif row + size.scan_step < size.rows:
            column, row = 0, row + size.scan_step
        else:
            column, row, state = size.first_column, 0, "B"
    return pixels


@pytest.mark.parametrize("size", [FULL, SMALL])
def test_declared_scan_matches_the_published_listing(size: ReadOut) -> None:
    assert list(size.scan()) == scan_by_hand(size)


def test_as_printed_scan_starts_at_column_1() -> None:
    pixels = list(FULL.scan())
    assert pixels[:2] == [None, (1, 15)]
    assert pixels[640:642] == [(0, 79), (1, 79)]
    assert pixels[5120:5123] == [(639, 463), (63, 0), (63, 1)]
    assert pixels[-1] == (703, 0)  # behind the picture


def test_nadir_scan_presents_the_declared_addresses() -> None:
    clocks = [{}] * (SMALL.scan_clocks - 1)
    addresses = simulated(NadirScan(SMALL), "scan", clocks, "address")
    places = [(a % 32, a // 32) for (a,) in addresses]
    assert places == list(SMALL.scan())[1:]


def found(picture: list[list[int]], *before: list[list[int]]) -> tuple[int, int]:
    """Coordinates after ``picture``, stored behind others with a reset between."""
    search, clocks = SunSearch(SMALL), []
    for number, stored in enumerate((*before, picture)):
        clocks += [{"start": 1, "store": 0}] * (number > 0)
        for y, row in enumerate(stored):
            for x, pixel in enumerate(row):
                clocks.append({"start": 0, "store": 1, "pixel": pixel, "address": 32 * y + x})
            clocks.append({"store": 0, "pixel": LIT, "address": 0})
    return simulated(search, "pix", clocks, "x", "y")[-1]  # type: ignore[return-value]


def lit(*places: tuple[int, int]) -> list[list[int]]:
    return [[LIT if (x, y) in places else DARK for x in range(21)] for y in range(13)]


@pytest.mark.parametrize(
    ("pictures", "place"),
    [
        ([lit((4, 2), (5, 2), (6, 2), (1, 7), (2, 7), (3, 7))], (4, 2)),  # the first of three stays
        ([lit((4, 2), (9, 9), (10, 9))], (9, 9)),  # a lone one is noted, and the last one stays
        ([lit((20, 3), (0, 4), (1, 4), (7, 8))], (20, 3)),  # three across the end of a row
        ([lit()], (0, 0)),
        ([lit(), lit((9, 9))], (9, 9)),  # nothing changes without a bright pixel
    ],
)
def test_as_printed_sun_search_notes_the_published_bright_pixel(
    pictures: list[list[list[int]]], place: tuple[int, int]
) -> None:
    assert found(*pictures) == place


def window(x: int, y: int) -> list[int]:
    block = SunWindow(SMALL)
    clocks = [{"x": x, "y": y}] * (4 + SMALL.window**2)
    seen = simulated(block, "window", clocks, "address", "coordinate")
    return [address for address, coordinate in seen if not coordinate]


@pytest.mark.parametrize("sun", [(8, 6), (1, 0), (20, 12), (0, 6)])
def test_as_printed_sun_window_wraps_at_the_image_border(sun: tuple[int, int]) -> None:
    left, top = SMALL.window_origin(*sun)
    assert (left, top) == (sun[0] - 2, sun[1] - 1)
    places = ((left + i) % 32 + 32 * ((top + j) % 16) for j in range(6) for i in range(5))
    stale, *addresses = window(*sun)
    assert stale == 0  # the place where the read-out before has ended: none
    assert addresses == list(islice(places, 1, 1 + len(addresses)))
