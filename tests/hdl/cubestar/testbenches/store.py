"""Storing a frame: which pixels reach the SRAM, and when ACK rises.

``PublishedTestbench.check`` compares every write pulse, ACK and the memory with the reference. What
a test asserts besides says in plain words what that must have come to.
"""

import random
from typing import Any

from cubestack.hdl.contract.bench.camera import flat, frame, line, lines, picture, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.testbench import checked_test, timed_test
from tests.hdl.cubestar.board import PublishedTestbench

COLUMNS, ROWS = GEOMETRY
TIMES = 4  # repetitions of a case, each with new pictures, blanking and moments


async def join(bench: PublishedTestbench, clock: int) -> None:
    await bench.camera.reach(clock)
    await bench.mcu.set(after=random.randrange(1, bench.camera.period - 10), ENABLE=1)


async def is_stored(bench: PublishedTestbench, content: bytes) -> None:
    """ACK comes without sending more, and the picture is in bank 0. Ends in standby."""
    await bench.camera.sent()
    assert await bench.mcu.acknowledged(4 * bench.camera.period)
    assert bench.stored() == content
    await bench.mcu.standby()


async def is_dropped(bench: PublishedTestbench) -> None:
    """All was sent, and ACK does not come; the next frame is stored. Ends in standby."""
    await bench.camera.sent()
    assert not await bench.mcu.acknowledged(4 * bench.camera.period)
    await bench.camera.started()  # its clock may have stalled since
    content = picture()
    bench.camera.send(frame(content))
    await is_stored(bench, content)


@checked_test(PublishedTestbench)
async def whole_frame(bench: PublishedTestbench) -> None:
    for _ in range(TIMES):
        bank = random.getrandbits(1)
        before = len(bench.sram.pulses)
        await bench.shoot(bank)
        assert [pulse.address for pulse in bench.sram.pulses[before:]] == GEOMETRY.addresses(bank)


@checked_test(PublishedTestbench)
async def joined_at_every_clock(bench: PublishedTestbench) -> None:
    """A frame that is joined in the middle is dropped, and the next one stored in its place."""
    between = 4
    positions = range(between + ROWS * (COLUMNS + 2))
    if len(positions) > 64:
        positions = sorted(random.sample(positions, 16))
    for position in positions:
        first = picture()
        start = await bench.camera.begin([*vsync(between), *flat(lines(first, 2))])
        await join(bench, start + position)
        if position + 2 < between:  # two clocks of reset, then HSYNC is still seen low
            await is_stored(bench, first)
        else:
            await is_dropped(bench)


@checked_test(PublishedTestbench)
async def split_picture_without_vsync(bench: PublishedTestbench) -> None:
    """Joined in a line, no VSYNC to the next frame: the rest of one, the start of the other."""
    for row in range(ROWS):
        first, second = picture(), picture()
        upper = [list(vsync()), *lines(first)]
        start = await bench.camera.begin(flat([*upper, *lines(second)]))
        start += len(flat(upper[: row + 1])) + random.randrange(COLUMNS - 1)
        await join(bench, start)
        next_line = (row + 1) * COLUMNS
        await is_stored(bench, first[next_line:] + second[:next_line])


@timed_test
async def ack_stays(dut: Any) -> None:
    """Over VSYNC and whole frames, with nothing stored, until ENABLE falls or RNW rises."""
    bench = await PublishedTestbench.start(dut)
    for release in ({"ENABLE": 0}, {"RNW": 1}) * 2:
        content = picture()
        await bench.begin(0, content)
        assert await bench.mcu.acknowledged()
        pulses = len(bench.sram.pulses)
        bench.camera.send([*frame(picture()), *frame(picture()), *vsync()])
        await bench.camera.sent()
        assert int(dut.ACK.value)
        assert (len(bench.sram.pulses), bench.stored()) == (pulses, content)
        await bench.mcu.set(**release)
        await bench.mcu.set(after=1)
        assert not int(dut.ACK.value)
        await bench.mcu.set(ENABLE=0, RNW=0)
    expected = await bench.check()
    last_pulses = [pulse.end for pulse in expected.pulses[GEOMETRY.pixels - 1 :: GEOMETRY.pixels]]
    assert [time for time, level in expected.ack if level] == last_pulses


@checked_test(PublishedTestbench)
async def vsync_starts_again(bench: PublishedTestbench) -> None:
    for _ in range(2 * TIMES):
        await bench.store()
        content = picture()
        bench.camera.send(frame(picture()[: random.randrange(1, ROWS * COLUMNS)]))
        bench.camera.send(frame(content))
        await is_stored(bench, content)


@checked_test(PublishedTestbench)
async def vsync_in_a_line_ends_it(bench: PublishedTestbench) -> None:
    """What follows VSYNC without HSYNC in between is no line's start."""
    for _ in range(TIMES):
        await bench.store()
        content = picture()
        levels = flat([level] * random.randrange(1, COLUMNS) for level in (1, 0, 1))
        broken = [Tick(random.randrange(256), 1, level) for level in levels]
        bench.camera.send([*frame(picture()[:-COLUMNS]), *broken, *line([])])
        bench.camera.send(flat(lines(content)))
        await is_stored(bench, content)


@checked_test(PublishedTestbench)
async def line_too_long(bench: PublishedTestbench) -> None:
    for _ in range(TIMES):
        await bench.store()
        content = picture()
        rows = [content[start:][:COLUMNS] for start in range(0, len(content), COLUMNS)]
        rows = [row + random.randbytes(random.choice([0, 1, 2, 3 * COLUMNS])) for row in rows]
        bench.camera.send([*vsync(), *flat(map(line, rows))])
        await is_stored(bench, content)


@checked_test(PublishedTestbench)
async def line_too_short(bench: PublishedTestbench) -> None:
    """The rest of the row stays as it was; the frame counts, unless it was the last row."""
    for _ in range(TIMES):
        await bench.store()
        old, new = bench.stored(), picture()
        sizes = [random.choice([1, COLUMNS - 1, COLUMNS]) for _ in range(ROWS - 1)] + [COLUMNS]
        rows = [new[row * COLUMNS :][:size] for row, size in enumerate(sizes)]
        bench.camera.send([*vsync(), *flat(map(line, rows))])
        kept = [old[row * COLUMNS :][size:COLUMNS] for row, size in enumerate(sizes)]
        await is_stored(bench, b"".join(flat(zip(rows, kept, strict=True))))


@checked_test(PublishedTestbench)
async def last_row_too_short(bench: PublishedTestbench) -> None:
    """No ACK; further lines are not stored either."""
    for _ in range(TIMES):
        await bench.store()
        cut = random.randrange(1, COLUMNS)
        before = len(bench.sram.pulses)
        bench.camera.send([*frame(picture()[:-cut]), *flat(lines(picture()))])
        await bench.camera.sent()
        assert len(bench.sram.pulses) - before == GEOMETRY.pixels - cut
        await is_dropped(bench)


@checked_test(PublishedTestbench)
async def hsync_missing(bench: PublishedTestbench) -> None:
    """Two lines in one: the second is surplus, and a row is missing at the end."""
    for _ in range(TIMES):
        await bench.store()
        rows = lines(picture())
        merged = random.randrange(ROWS - 1)
        rows[merged] = [tick for tick in rows[merged] if tick.hsync]
        bench.camera.send([*vsync(), *flat(rows)])
        await is_dropped(bench)


@timed_test
async def any_waveform(dut: Any) -> None:
    """Runs of any length on both sync lines, joined and left at any time."""
    bench = await PublishedTestbench.start(dut)
    for _ in range(200 * ROWS):
        size = random.choice([COLUMNS] * 6 + [1, COLUMNS - 1, COLUMNS + 1, 2 * COLUMNS])
        bench.camera.send(line(random.randbytes(size)))
        if random.random() < 0.4 / ROWS:
            levels = [(random.getrandbits(1), random.getrandbits(1)) for _ in range(3)]
            bench.camera.send(Tick(random.randrange(256), *pair) for pair in levels)
    for _ in range(40):
        await bench.mcu.store(random.getrandbits(1))
        await bench.mcu.acknowledged(3 * ROWS * COLUMNS * bench.camera.period)
        await bench.mcu.standby()
    expected = await bench.check()
    assert any(level for _, level in expected.ack)
