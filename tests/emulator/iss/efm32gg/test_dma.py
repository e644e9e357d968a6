"""DMA: all cycle types, requests of units, errors, priorities, interrupts."""

import struct

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind

from .bench import US, Bench, S, asleep, mask_of

HZ = 14_000_000
BASE, ALTERNATE = 0x2000_0400, 0x2000_0500
DATA, TARGET, TASKS = 0x2000_1000, 0x2000_2000, 0x2000_3000
UNUSED = 0x6000_0000
STOP, BASIC, AUTO, PING_PONG, MEMORY, PERIPHERAL = 0, 1, 2, 3, 4, 6
BYTES, HALVES, WORDS, FIXED = 0, 1, 2, 3
UART0_RX, UART0_TX = 44 << 16, 44 << 16 | 1
UART0 = 3
RXDATA, TXDATA = 0x4000_E01C, 0x4000_E034


def control(cycle: int, count: int, size: int = WORDS, power: int = 0, *,
            source: int | None = None, target: int | None = None) -> int:  # fmt: skip
    source = size if source is None else source
    target = size if target is None else target
    return (
        cycle | (count - 1) << 4 | power << 14 | size << 24 | source << 26 | size << 28
        | target << 30
    )  # fmt: skip


def describe(bench: Bench, channel: int, source_end: int, target_end: int, word: int,
             base: int = BASE) -> None:  # fmt: skip
    bench.machine.poke(base + 16 * channel, struct.pack("<4I", source_end, target_end, word, 0))


def dma() -> Bench:
    bench = asleep(1, interrupts=False).clock("DMA")
    bench.machine.poke(DATA, bytes(range(256)))
    return bench.load("DMA", CTRLBASE=BASE, CONFIG=1)


def transfer(bench: Bench, source_end: int, target_end: int, word: int) -> None:
    """Request a transfer by channel 0 and wait for its end."""
    describe(bench, 0, source_end, target_end, word)
    bench.load("DMA", CHENS=1, CHSWREQ=1)
    bench.run_for(100 * US)


def receive(bench: Bench, *data: int) -> None:
    for byte in data:
        bench.machine.uart_receive(UART0, byte)
        bench.run_for(20 * US)


def words(bench: Bench, address: int, count: int) -> list[int]:
    return list(struct.unpack(f"<{count}I", bench.machine.peek(address, 4 * count)))


def control_word(bench: Bench, channel: int = 0) -> int:
    return words(bench, BASE + 16 * channel + 8, 1)[0]


def test_automatic_transfer_copies_and_stops() -> None:
    bench = dma()
    transfer(bench, DATA + 4 * 31, TARGET + 4 * 31, control(AUTO, 32, power=3))
    assert words(bench, TARGET, 33) == [*words(bench, DATA, 32), 0]
    assert (bench["DMA.IF"], bench["DMA.CHENS"]) == (1, 0)
    assert control_word(bench) & 0x3FF7 == 0  # stopped, and nothing is left


@pytest.mark.parametrize("size", [BYTES, HALVES, WORDS])
def test_dma_applies_item_sizes_and_increments(size: int) -> None:
    bench = dma()
    width = 1 << size
    word = control(AUTO, 8, size, 10, target=WORDS)
    transfer(bench, DATA + 7 * width, TARGET + 7 * 4, word)
    data = bench.machine.peek(DATA, 8 * width)
    expected = [int.from_bytes(data[n : n + width], "little") for n in range(0, 8 * width, width)]
    assert words(bench, TARGET, 8) == expected


def test_basic_transfer_moves_2_to_the_r_items_per_request() -> None:
    bench = dma()
    describe(bench, 2, DATA + 4 * 9, TARGET + 4 * 9, control(BASIC, 10, power=2))
    bench["DMA.CHENS"] = 4
    for left, done in ((6, 0), (2, 0), (0, 4)):
        bench["DMA.CHSWREQ"] = 4
        bench.run_for(10 * US)
        assert bench["DMA.IF"] == done
        assert done or control_word(bench, 2) >> 4 & 0x3FF == left - 1
    assert words(bench, TARGET, 10) == words(bench, DATA, 10)


def receiver() -> Bench:
    bench = dma().clock("UART0", "GPIO")
    bench["GPIO.PF_MODEL"] = 4 << 24 | 1 << 28
    bench.load("UART0", ROUTE=3, CMD=5)
    return bench


def test_uart_receives_by_ping_pong() -> None:
    bench = receiver()
    word = control(PING_PONG, 4, BYTES, source=FIXED)
    describe(bench, 0, RXDATA, TARGET + 3, word)
    describe(bench, 0, RXDATA, TARGET + 7, word, ALTERNATE)
    bench.load("DMA", CH0_CTRL=UART0_RX, IEN=1, CHENS=1)
    received = []
    for byte in range(20):
        receive(bench, 0x40 + byte)
        assert not bench.is_set("UART0.STATUS.RXDATAV")
        if byte % 4 == 3:
            second = byte // 4 % 2
            assert (bench["DMA.IF"], bench["DMA.CHALTS"]) == (1, 1 - second)
            bench["DMA.IFC"] = 1
            at = TARGET + 4 * second
            received += bench.machine.peek(at, 4)
            describe(bench, 0, RXDATA, at + 3, word, ALTERNATE if second else BASE)
        else:
            assert bench["DMA.IF"] == 0
    assert received == [0x40 + byte for byte in range(20)]


def test_dma_ping_pong_ends_at_a_used_descriptor() -> None:
    bench = receiver()
    word = control(PING_PONG, 1, BYTES, source=FIXED)
    describe(bench, 0, RXDATA, TARGET, word)
    describe(bench, 0, RXDATA, TARGET + 1, word, ALTERNATE)
    bench.load("DMA", CH0_CTRL=UART0_RX, CHENS=1)
    receive(bench, 0x55, 0x55, 0x55)
    assert bench["DMA.CHENS"] == 0
    assert bench.is_set("UART0.STATUS.RXDATAV")


def test_uart_sends_text_by_dma() -> None:
    bench = receiver()
    text = b"Hello from the DMA"
    bench.machine.poke(DATA, text)
    describe(bench, 1, DATA + len(text) - 1, TXDATA, control(BASIC, len(text), BYTES, target=3))
    bench.load("DMA", CH1_CTRL=UART0_TX, CHENS=2)
    bench.run_for(len(text) * 10 * 17 * S // HZ)
    assert bytes(item.value for item in bench.out(OutgoingKind.UART)) == text
    assert bench["DMA.IF"] == 2


def test_masked_dma_request_waits() -> None:
    bench = receiver()
    describe(bench, 0, RXDATA, TARGET, control(BASIC, 1, BYTES, source=FIXED))
    bench.load("DMA", CH0_CTRL=UART0_RX, CHREQMASKS=1, CHENS=1)
    receive(bench, 0x55)
    assert (bench["DMA.CHREQSTATUS"], bench["DMA.IF"]) == (1, 0)
    bench["DMA.CHREQMASKC"] = 1
    bench.run_for(20 * US)
    assert bench["DMA.IF"] == 1


def scatter_gather(bench: Bench, cycle: int, *tasks: tuple[int, int, int]) -> None:
    """Descriptors of tasks, which the primary descriptor of channel 0 copies to the alternate."""
    bench.machine.poke(TASKS, b"".join(struct.pack("<4I", *task, 0) for task in tasks))
    word = control(cycle, 4 * len(tasks), WORDS, 2)
    describe(bench, 0, TASKS + 16 * len(tasks) - 4, ALTERNATE + 12, word)


def test_dma_memory_scatter_gather_runs_its_tasks() -> None:
    bench = dma()
    scatter_gather(
        bench,
        MEMORY,
        (DATA + 3, TARGET + 3, control(5, 4, BYTES, 2)),
        (DATA + 19, TARGET + 0x103, control(5, 4, BYTES, 2)),
        (DATA + 0x4C, TARGET + 0x20C, control(AUTO, 4, WORDS, 2)),
    )
    bench.load("DMA", CHENS=1, CHSWREQ=1)
    bench.run_for(100 * US)
    for target, start, count in ((0, 0, 4), (0x100, 16, 4), (0x200, 0x40, 16)):
        assert bench.machine.peek(TARGET + target, count) == bytes(range(start, start + count))
    assert (bench["DMA.IF"], bench["DMA.CHENS"]) == (1, 0)


def test_peripheral_scatter_gather_waits_for_requests() -> None:
    bench = receiver()
    scatter_gather(
        bench,
        PERIPHERAL,
        (RXDATA, TARGET + 1, control(7, 2, BYTES, source=FIXED)),
        (RXDATA, TARGET + 0x101, control(BASIC, 2, BYTES, source=FIXED)),
    )
    bench.load("DMA", CH0_CTRL=UART0_RX, CHENS=1)
    for byte in (0x11, 0x22, 0x33, 0x44):
        assert bench["DMA.IF"] == 0
        receive(bench, byte)
    assert bench.machine.peek(TARGET, 2) == b"\x11\x22"
    assert (bench.machine.peek(TARGET + 0x100, 2), bench["DMA.IF"]) == (b"\x33\x44", 1)


@pytest.mark.parametrize("bad", ["source", "target", "descriptor"])
def test_bus_error_disables_the_channel_and_sets_error(bad: str) -> None:
    bench = dma()
    if bad == "descriptor":
        bench["DMA.CTRLBASE"] = UNUSED
    source, target = (UNUSED if bad == name else TARGET for name in ("source", "target"))
    transfer(bench, source, target, control(AUTO, 1))
    assert bench["DMA.IF"] & 1 << 31
    assert (bench["DMA.ERRORC"], bench["DMA.CHENS"]) == (1, 0)
    bench["DMA.ERRORC"] = 1
    assert bench["DMA.ERRORC"] == 0


def test_high_priority_is_served_first() -> None:
    bench = dma()
    for channel in (0, 1):
        target = TARGET + 0x1000 * channel
        describe(bench, channel, DATA + 4 * 255, target + 4 * 255, control(AUTO, 256))
    bench.load("DMA", CHPRIS=2, CHENS=3, CHSWREQ=3)
    for _ in range(1000):
        bench.run_for(US)
        if bench["DMA.IF"]:
            break
    assert bench["DMA.IF"] == 2


@pytest.mark.parametrize("name", ["CMU.HFCORECLKEN0", "DMA.CONFIG"])
def test_no_transfer_without_clock_or_enable(name: str) -> None:
    bench = dma()
    bench[name] = 0
    transfer(bench, DATA + 4, TARGET, control(AUTO, 1))
    assert words(bench, TARGET, 1) == [0]
    bench.clock("DMA").load("DMA", CONFIG=1)
    transfer(bench, DATA + 4, TARGET, control(AUTO, 1))
    assert words(bench, TARGET, 1) != [0]


def test_dma_base_registers_are_aligned() -> None:
    bench = dma()
    bench["DMA.CTRLBASE"] = 0x2000_07FF
    assert bench["DMA.CTRLBASE"] == 0x2000_0600
    assert bench["DMA.ALTCTRLBASE"] == 0x2000_0700
    assert bench["DMA.STATUS"] & mask_of("DMA.STATUS.CHNUM") == 11 << 16
