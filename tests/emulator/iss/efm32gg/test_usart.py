"""USART and UART: bauds to the picosecond, frames, buffers, flags, routes."""

from fractions import Fraction

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind
from tests.together import together

from .bench import Bench, S, asleep, mask_of

HZ = 14_000_000
PUSH_PULL, INPUT = 4, 1
PF6, PF7 = 5 * 16 + 6, 5 * 16 + 7
UART0 = 3


def uart(clkdiv: int = 0, frame: int = 0x1005, control: int = 0) -> Bench:
    """UART0 on PF6 and PF7, both directions on."""
    bench = Bench().clock("UART0", "GPIO")
    bench["GPIO.PF_MODEL"] = PUSH_PULL << 24 | INPUT << 28
    bench.load("UART0", CTRL=control, FRAME=frame, CLKDIV=clkdiv, ROUTE=3, CMD=0x5)
    return bench


def bit_ps(clkdiv: int, oversampling: int = 16) -> Fraction:
    return Fraction(oversampling * (256 + clkdiv), 256) * S / HZ


def sent(bench: Bench) -> list[int]:
    return [item.value for item in bench.out(OutgoingKind.UART)]


@together("clkdiv", [0, 64, 3648, 14 << 8 | 0xC0, 0x1FFFC0])
@together(("ovs", "oversampling"), [(0, 16), (1, 8), (2, 6), (3, 4)])
def test_usart_character_has_its_duration(clkdiv: int, ovs: int, oversampling: int) -> None:
    bench = uart(clkdiv, control=ovs << 5)
    bench["UART0.TXDATA"] = 0x5A
    frame_ps = 10 * bit_ps(clkdiv, oversampling)
    [item] = bench.out(OutgoingKind.UART)
    assert (item.unit, item.value) == (UART0 | PF6 << 8, 0x5A)
    assert item.extra in (int(frame_ps), int(frame_ps) + 1)


def test_back_to_back_characters_do_not_drift() -> None:
    bench = uart(3648 & ~0x3F)
    bench["UART0.TXDATA"] = 0
    starts = []
    for count in range(200):
        while not bench.is_set("UART0.STATUS.TXBL"):
            bench.run_for(10**7)
        bench["UART0.TXDATA"] = count
        starts += [item.time_ps for item in bench.out(OutgoingKind.UART)]
    frame_ps = 10 * bit_ps(3648)
    assert len(starts) > 190
    for count, start in enumerate(starts):
        assert abs(start - starts[0] - count * frame_ps) <= 1


@pytest.mark.parametrize(
    ("frame", "halves"),
    [
        (0x1005, 20),  # 8N1
        (0x1205, 22),  # 8E1
        (0x3305, 24),  # 8O2
        (0x2005, 21),  # 8N1.5
        (0x0004, 17),  # 7N0.5
        (0x1006, 22),  # 9N1
        (0x1001, 12),  # 4N1
    ],
)
def test_usart_frame_formats_have_their_durations(frame: int, halves: int) -> None:
    bench = uart(0, frame)
    bench["UART0.TXDATAX"] = 0x1FF
    [item] = bench.out(OutgoingKind.UART)
    assert item.extra == int(halves * bit_ps(0) / 2)
    assert item.value == (1 << ((frame & 15) + 3)) - 1


def test_transmit_buffer_holds_two_characters_beside_the_one_being_sent() -> None:
    bench = uart()
    for byte in (1, 2, 3):
        bench["UART0.TXDATA"] = byte
    assert not bench.is_set("UART0.IF.TXOF")
    assert not bench.is_set("UART0.STATUS.TXBL")
    bench["UART0.TXDATA"] = 4
    assert bench.is_set("UART0.IF.TXOF")
    bench.run_for(11 * int(bit_ps(0)))
    assert not bench.is_set("UART0.STATUS.TXC")
    bench.run_for(20 * int(bit_ps(0)))
    assert sent(bench) == [1, 2, 3]
    assert bench.is_set("UART0.STATUS.TXC")
    assert bench.is_set("UART0.IF.TXC")


def test_txbil_sets_the_buffer_level_at_half_full() -> None:
    bench = uart(control=mask_of("USART.CTRL.TXBIL"))
    bench["UART0.TXDATA"] = 1
    bench["UART0.TXDATA"] = 2
    assert bench.is_set("UART0.STATUS.TXBL")
    bench["UART0.TXDATA"] = 3
    assert not bench.is_set("UART0.STATUS.TXBL")


def test_nothing_is_sent_without_route_pin_clock_or_transmitter() -> None:
    for name, value in (("UART0.ROUTE", 1), ("GPIO.PF_MODEL", 0), ("CMU.HFPERCLKEN0", 1 << 13)):
        bench = uart()
        bench[name] = value
        bench["UART0.TXDATA"] = 1
        bench.run_for(20 * int(bit_ps(0)))
        assert sent(bench) == []
    bench = uart()
    bench.command("UART0.CMD.TXDIS")
    bench["UART0.TXDATA"] = 1
    assert sent(bench) == []
    bench.command("UART0.CMD.TXEN")
    assert sent(bench) == [1]


def test_usart_sends_break_and_disables_after_a_character() -> None:
    bench = uart()
    bench["UART0.TXDATAX"] = mask_of("USART.TXDATAX.TXBREAK") | mask_of("USART.TXDATAX.TXDISAT")
    assert sent(bench) == [0x10000]
    bench.run_for(11 * int(bit_ps(0)))
    assert not bench.is_set("UART0.STATUS.TXENS")


def test_receive_buffer_overflows_at_the_fourth_character() -> None:
    bench = uart()
    bench.machine.uart_receive(UART0, 0x11)
    assert bench.is_set("UART0.STATUS.RXDATAV")
    assert not bench.is_set("UART0.STATUS.RXFULL")
    bench.machine.uart_receive(UART0, 0x22)
    assert bench.is_set("UART0.STATUS.RXFULL")
    bench.machine.uart_receive(UART0, 0x33)  # waits in the shift register
    assert not bench.is_set("UART0.IF.RXOF")
    bench.machine.uart_receive(UART0, 0x44)
    assert bench.is_set("UART0.IF.RXOF")
    assert bench["UART0.RXDATAXP"] == 0x11
    assert [bench["UART0.RXDATA"] for _ in range(3)] == [0x11, 0x22, 0x44]
    assert not bench.is_set("UART0.IF.RXUF")
    assert bench["UART0.RXDATA"] == 0
    assert bench.is_set("UART0.IF.RXUF")


def test_usart_reports_framing_and_parity_errors_per_character() -> None:
    bench = uart()
    bench.machine.uart_receive(UART0, 0x55, 1)
    bench.machine.uart_receive(UART0, 0x66, 2)
    assert bench.is_set("UART0.IF.FERR")
    assert bench.is_set("UART0.IF.PERR")
    assert bench["UART0.RXDATAX"] == 0x8055
    assert bench["UART0.RXDATAX"] == 0x4066


def test_wrong_bit_rate_is_a_framing_error() -> None:
    bench = uart(3648)
    bench.machine.uart_receive(UART0, 0x55, round(S / bit_ps(3648)) << 8)
    assert bench["UART0.RXDATAX"] == 0x55
    bench.machine.uart_receive(UART0, 0x55, 115200 << 8)
    assert bench["UART0.RXDATAX"] & 0x8000


def test_character_is_received_by_the_unit_at_the_pin() -> None:
    bench = uart()
    bench.machine.uart_receive(0x100 | PF6, 0x11)
    assert not bench.is_set("UART0.STATUS.RXDATAV")
    bench.machine.uart_receive(0x100 | PF7, 0x11)
    assert bench["UART0.RXDATA"] == 0x11
    bench["GPIO.PF_MODEL"] = PUSH_PULL << 24
    bench.machine.uart_receive(0x100 | PF7, 0x11)
    assert not bench.is_set("UART0.STATUS.RXDATAV")


def test_usart_double_registers_hold_two_characters() -> None:
    bench = uart()
    bench["UART0.TXDOUBLE"] = 0x4241
    bench.run_for(22 * int(bit_ps(0)))
    assert sent(bench) == [0x41, 0x42]
    bench.machine.uart_receive(UART0, 0x31)
    bench.machine.uart_receive(UART0, 0x32)
    assert (bench["UART0.RXDOUBLEXP"], bench["UART0.RXDOUBLE"]) == (0x32_0031, 0x3231)


def test_usart_loopback_receives_the_sent_byte() -> None:
    bench = uart(control=mask_of("USART.CTRL.LOOPBK"))
    bench["UART0.TXDATA"] = 0xA5
    bench.run_for(9 * int(bit_ps(0)))
    assert not bench.is_set("UART0.STATUS.RXDATAV")
    bench.run_for(2 * int(bit_ps(0)))
    assert bench["UART0.RXDATA"] == 0xA5


def test_multiprocessor_mode_passes_only_addresses() -> None:
    bench = uart(frame=0x1006, control=mask_of("USART.CTRL.MPM") | mask_of("USART.CTRL.MPAB"))
    bench.command("UART0.CMD.RXBLOCKEN")
    bench.machine.uart_receive(UART0, 0x055)
    assert not bench.is_set("UART0.STATUS.RXDATAV")
    bench.machine.uart_receive(UART0, 0x1AA)
    assert bench.is_set("UART0.IF.MPAF")
    assert bench["UART0.RXDATAX"] == 0x1AA


def test_receiver_and_transmitter_have_separate_interrupts() -> None:
    bench = uart()
    pending = 0xE000_E200
    bench["UART0.IEN"] = mask_of("USART.IEN.RXDATAV")
    bench.machine.uart_receive(UART0, 1)
    assert bench.machine.read(pending) == 1 << 20
    bench["UART0.IEN"] = mask_of("USART.IEN.TXBL")
    bench.run_for(1000)
    value = bench.machine.read(pending)
    assert value is not None
    assert value & 1 << 21


def test_spi_master_sends_words_and_receives_the_idle_line() -> None:
    bench = Bench().clock("USART1", "GPIO")
    bench["GPIO.PD_MODEL"] = PUSH_PULL | INPUT << 4
    bench.load("USART1", CTRL=mask_of("USART.CTRL.SYNC"), CLKDIV=256, ROUTE=0xB | 1 << 8, CMD=0x15)
    bench["USART1.TXDATA"] = 0x9F
    [item] = bench.out(OutgoingKind.SPI)
    assert item.value == 0x9F
    assert item.extra == 8 * 4 * S // HZ  # 14 MHz / (2 * (1 + 256 / 256))
    bench.run_for(9 * 4 * S // HZ)
    assert bench["USART1.RXDATA"] == 0xFF


def test_uart_receives_nothing_in_em2() -> None:
    bench = asleep(mode=2)
    bench.clock("UART0", "GPIO")
    bench["GPIO.PF_MODEL"] = INPUT << 28
    bench.load("UART0", ROUTE=1, CMD=1)
    bench.machine.uart_receive(UART0, 1)
    assert not bench.peek("UART0.STATUS") & mask_of("USART.STATUS.RXDATAV")
