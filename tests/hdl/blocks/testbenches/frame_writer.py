"""The writer alone, clock by clock, against the reference."""

import random
from collections.abc import Iterable
from typing import Any, NamedTuple

import cocotb

from cubestack.hdl.contract.bench.camera import flat, frame, line, lines, picture, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.timing import clock
from tests.hdl.harness.reference import taken


class Seen(NamedTuple):
    """Outputs after one rising edge; address and data count while ``store`` is high only."""

    store: int
    ack: int
    written: tuple[int, int] | None


async def take(dut: Any, tick: Tick, reset: int = 0) -> Seen:
    await clock(dut, "pix", reset, **tick._asdict())
    store, ack = int(dut.store.value), int(dut.ack.value)
    return Seen(store, ack, (int(dut.address.value), int(dut.data.value)) if store else None)


async def compare(dut: Any, ticks: Iterable[Tick]) -> bool:
    """Clock the ticks in after a reset, each output as the reference says; whether ACK came."""
    ticks = list(ticks)
    assert await take(dut, Tick(255, 1, 1), reset=1) == Seen(0, 0, None)
    pixels, ack = taken(ticks, GEOMETRY)
    addresses = dict(pixels)
    for index, tick in enumerate(ticks):
        written = (addresses[index], tick.pixel) if index in addresses else None
        expected = Seen(index in addresses, ack is not None and index >= ack, written)
        assert await take(dut, tick) == expected
    return ack is not None


@cocotb.test()
async def stores_a_frame_and_no_more(dut: Any) -> None:
    for _ in range(4):
        frames = [frame(picture()), frame(picture()), flat(lines(picture()))]
        assert await compare(dut, flat(frames))


@cocotb.test()
async def drops_what_it_joins_in_the_middle(dut: Any) -> None:
    content = frame(picture())
    for start in random.sample(range(10, len(content)), 4):
        assert not await compare(dut, content[start:])
        assert await compare(dut, content[start:] + frame(picture()) + list(line([])))


@cocotb.test()
async def any_waveform(dut: Any) -> None:
    acknowledged = 0
    for _ in range(20):
        ticks: list[Tick] = []
        while len(ticks) < 4 * GEOMETRY.pixels:
            size = random.choice([GEOMETRY.columns] * 6 + [1, GEOMETRY.columns + 1])
            ticks += line(random.randbytes(size))
            if random.random() < 0.4 / GEOMETRY.rows:
                ticks += vsync()
            if random.random() < 0.1 / GEOMETRY.rows:
                ticks += [Tick(0, *divmod(random.randrange(4), 2)) for _ in range(3)]
        acknowledged += await compare(dut, ticks)
    assert acknowledged
