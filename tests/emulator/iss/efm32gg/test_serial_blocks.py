"""Every serial block at every location: pins, clock, interrupts, DMA requests, bit rate."""

from fractions import Fraction

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind
from cubestack.firmware_model.interface.efm32gg import SERIAL
from cubestack.firmware_model.interface.efm32gg.pins import SERIAL_UNITS, serial_locations
from tests.together import together

from .bench import MS, Bench, S, address_of

PUSH_PULL, INPUT = 4, 1
BY_PIN = 0x100
CORE_HZ, LFRCO_HZ = 14_000_000, 32_768
INTERRUPTS = {one.name: one.interrupts for layout in SERIAL for one in layout.instances}
# EFM32GG Reference Manual, 8.7.3: DMA_CHn_CTRL.SOURCESEL; signals: 0 data received, 1 buffer empty.
DMA_SOURCES = dict(zip(SERIAL_UNITS, (12, 13, 14, 44, 45, 16, 17), strict=True))

ROUTED = [
    (unit, location, tx, rx)
    for unit in SERIAL_UNITS
    for location, (tx, rx) in enumerate(serial_locations(unit))
]


def mode(bench: Bench, pin: int, value: int) -> None:
    port, bit = divmod(pin, 16)
    register = f"GPIO.P{'ABCDEF'[port]}_MODE{'LH'[bit // 8]}"
    bench[register] |= value << 4 * (bit % 8)


def serial(unit: str, location: int, clkdiv: int = 0) -> Bench:
    """A block with both directions on, at its pins of ``location``."""
    low_energy = unit.startswith("LE")
    bench = Bench().clock("GPIO", "LE" if low_energy else unit)
    if low_energy:
        bench.command("CMU.OSCENCMD.LFRCOEN")
        bench.load("CMU", LFCLKSEL=0x5, LFBCLKEN0=3)
        bench.run_for(2 * MS)
    tx, rx = serial_locations(unit)[location]
    mode(bench, tx, PUSH_PULL)
    mode(bench, rx, INPUT)
    bench.load(unit, CLKDIV=clkdiv, ROUTE=3 | location << 8, CMD=0x5)
    bench.run_for(MS)
    bench.log()
    return bench


def character_s(unit: str, clkdiv: int) -> Fraction:
    """Ten bits: Reference Manual, 17.3.2.3 (oversampling 16) and 19.3.3."""
    if unit.startswith("LE"):
        return 10 * (1 + Fraction(clkdiv, 256)) / LFRCO_HZ
    return 10 * 16 * (1 + Fraction(clkdiv, 256)) / CORE_HZ


@together(("unit", "location", "tx", "rx"), ROUTED)
def test_block_sends_and_receives_at_the_pins_of_its_location(
    unit: str, location: int, tx: int, rx: int
) -> None:
    bench, number = serial(unit, location), SERIAL_UNITS.index(unit)
    bench[f"{unit}.TXDATA"] = 0x5A
    bench.run_for(MS)
    assert [(one.unit, one.value) for one in bench.out(OutgoingKind.UART)] == [
        (number | tx << 8, 0x5A)
    ]
    bench.machine.uart_receive(BY_PIN | rx, 0xA5)
    assert bench[f"{unit}.RXDATA"] == 0xA5
    bench.machine.uart_receive(BY_PIN | tx, 0xA5)
    assert not bench.is_set(f"{unit}.STATUS.RXDATAV")
    bench.machine.uart_receive(number, 0x3C)
    assert bench[f"{unit}.RXDATA"] == 0x3C
    assert bench.log() == ""


@together("clkdiv", [0, 0x200, 0x7FC0])
@together("unit", SERIAL_UNITS)
def test_character_time_follows_the_formula_of_the_manual(unit: str, clkdiv: int) -> None:
    bench = serial(unit, 0, clkdiv)
    bench[f"{unit}.TXDATA"] = 0
    bench.run_for(MS)
    [item] = bench.out(OutgoingKind.UART)
    assert abs(item.extra - character_s(unit, clkdiv) * S) <= 1


@pytest.mark.parametrize("unit", SERIAL_UNITS)
def test_block_raises_its_own_interrupts(unit: str) -> None:
    bench = serial(unit, 0)
    numbers = list(INTERRUPTS[unit].values())
    bench[f"{unit}.IEN"] = 0x4  # RXDATAV
    bench.machine.uart_receive(SERIAL_UNITS.index(unit), 1)
    assert bench.pending() == numbers[:1]
    bench[f"{unit}.IEN"] = 0x2  # TXBL
    assert numbers[-1] in bench.pending()


@pytest.mark.parametrize("unit", SERIAL_UNITS)
def test_dma_feeds_and_empties_the_block(unit: str) -> None:
    bench = serial(unit, 0)
    start, count = 0x2000_1000, 5
    bench.machine.poke(start, bytes(range(1, 1 + count)))
    # Bytes; the source or the target increments; basic cycle.
    to_block = 3 << 30 | 0 << 26 | (count - 1) << 4 | 1
    bench.dma(0, DMA_SOURCES[unit] << 16 | 1,
              start + count - 1, address_of(f"{unit}.TXDATA"), to_block)  # fmt: skip
    bench.run_for(10 * MS)
    assert [one.value for one in bench.out(OutgoingKind.UART)] == list(range(1, 1 + count))
    from_block = 0 << 30 | 3 << 26 | (count - 1) << 4 | 1
    bench.dma(1, DMA_SOURCES[unit] << 16,
              address_of(f"{unit}.RXDATA"), start + 0x100 + count - 1, from_block)  # fmt: skip
    for byte in b"hello":
        bench.machine.uart_receive(SERIAL_UNITS.index(unit), byte)
        bench.run_for(MS)
    assert bench.machine.peek(start + 0x100, count) == b"hello"


@pytest.mark.parametrize("unit", SERIAL_UNITS)
def test_block_without_its_clock_is_silent(unit: str) -> None:
    bench = serial(unit, 0)
    bench["CMU.LFBCLKEN0" if unit.startswith("LE") else "CMU.HFPERCLKEN0"] = 1 << 13
    bench.run_for(MS)
    bench[f"{unit}.TXDATA"] = 1
    bench.run_for(MS)
    bench.machine.uart_receive(SERIAL_UNITS.index(unit), 1)
    assert bench.out(OutgoingKind.UART) == []
    assert not bench.peek(f"{unit}.STATUS") & 0x20  # RXDATAV of LEUART; USART: TXC
