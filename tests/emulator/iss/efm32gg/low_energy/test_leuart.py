"""LEUART: characters, commands, frames and DMA in EM2."""

from cubestack.emulator.iss.outcome import OutgoingKind

from ..bench import MS, US, Bench, S, mask_of
from .domain import HZ, INPUT, LEUART0, PD4, PD5, PUSH_PULL, TICK, low


def leuart(clkdiv: int = 617, control: int = 0, *, interrupts: bool = False) -> Bench:
    bench = low(2, "LEUART0", interrupts=interrupts)
    bench["GPIO.PD_MODEL"] = PUSH_PULL << 16 | INPUT << 20
    bench.load("LEUART0", ROUTE=3, CTRL=control, CLKDIV=clkdiv & 0x7FF8, CMD=5)
    bench.run_for(4 * TICK)
    return bench


def test_leuart_sends_at_9600_baud_in_em2() -> None:
    bench = leuart()
    for byte in b"go":
        bench["LEUART0.TXDATA"] = byte
        while bench["LEUART0.SYNCBUSY"]:
            bench.run_for(TICK)
    bench.run_for(3 * MS)
    items = bench.out(OutgoingKind.UART)
    assert [item.value for item in items] == list(b"go")
    assert items[0].unit == LEUART0 | PD4 << 8
    expected = 10 * (256 + 616) * S // 256 // HZ
    assert abs(items[0].extra - expected) <= 1
    assert abs(items[1].time_ps - items[0].time_ps - expected) <= 1
    assert bench.is_set("LEUART0.STATUS.TXC")
    assert bench.machine.energy_mode == 2


def test_leuart_commands_take_two_to_three_clocks() -> None:
    bench = leuart()
    bench["LEUART0.CMD"] = 2
    assert bench["LEUART0.SYNCBUSY"] == 2
    assert bench.is_set("LEUART0.STATUS.RXENS")
    bench.run_for(4 * TICK)
    assert bench["LEUART0.SYNCBUSY"] == 0
    assert not bench.is_set("LEUART0.STATUS.RXENS")


def test_later_of_opposite_leuart_commands_wins() -> None:
    bench = leuart()
    bench["LEUART0.CMD"] = mask_of("LEUART.CMD.RXDIS")
    bench["LEUART0.CMD"] = mask_of("LEUART.CMD.RXEN") | mask_of("LEUART.CMD.TXDIS")
    bench.run_for(4 * TICK)
    assert bench.is_set("LEUART0.STATUS.RXENS")
    assert not bench.is_set("LEUART0.STATUS.TXENS")


def test_received_character_wakes_from_em2() -> None:
    bench = leuart(interrupts=True)
    bench["LEUART0.IEN"] = 4
    bench.out(OutgoingKind.SLEEP)
    bench.machine.uart_receive(0x100 | PD5, 0x7E)
    bench.run_for(US)
    assert bench.out(OutgoingKind.SLEEP)[0].value == 0
    assert bench["LEUART0.RXDATA"] == 0x7E


def test_leuart_recognises_start_and_signal_frames() -> None:
    bench = leuart(control=mask_of("LEUART.CTRL.SFUBRX"))
    bench.load("LEUART0", STARTFRAME=0x02, SIGFRAME=0x03, CMD=0x10)
    bench.run_for(4 * TICK)
    for byte in b"ab\x02hi\x03":
        bench.machine.uart_receive(LEUART0, byte)
        if byte == 0x62:
            assert not bench.is_set("LEUART0.STATUS.RXDATAV")
        elif byte > 3 or byte == 2:
            assert bench.is_set("LEUART0.IF.STARTF") == (byte not in b"ab")
    assert bench.is_set("LEUART0.IF.SIGF")
    assert bench["LEUART0.RXDATA"] == 2


def test_leuart_buffers_two_characters_and_the_shift_register() -> None:
    bench = leuart()
    for byte in range(4):
        assert not bench.is_set("LEUART0.IF.RXOF")
        bench.machine.uart_receive(LEUART0, byte)
    assert bench.is_set("LEUART0.IF.RXOF")
    assert [bench["LEUART0.RXDATA"] for _ in range(3)] == [0, 1, 3]


def test_dma_reads_characters_in_em2_with_rxdmawu() -> None:
    bench = leuart(control=mask_of("LEUART.CTRL.RXDMAWU"))
    word = 3 << 26 | 3 << 4 | 1  # basic, four bytes from a fixed address
    bench.dma(0, 16 << 16, 0x4008_401C, 0x2000_1003, word)
    for byte in b"abcd":
        bench.machine.uart_receive(LEUART0, byte)
        bench.run_for(MS)
    assert bench.machine.energy_mode == 2
    assert (bench.machine.peek(0x2000_1000, 4), bench["DMA.IF"]) == (b"abcd", 1)
