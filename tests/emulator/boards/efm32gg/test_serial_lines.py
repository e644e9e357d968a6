"""Every serial block at every pair of its pins, led out and answering."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from cubestack.emulator.boards.efm32gg.board import Efm32ggBoard
from cubestack.emulator.boards.serial_routes import SerialRoute, parse_routes
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.iss.image import Image
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.pins import PINS, SERIAL_UNITS, serial_locations
from tests.emulator.boards.efm32gg.programs import needs_both_compilers
from tests.together import together

pytestmark = needs_both_compilers

PLACES = [
    (block, location, f"{block.lower()}@{PINS[tx]},{PINS[rx]}")
    for block in SERIAL_UNITS
    for location, (tx, rx) in enumerate(serial_locations(block))
]


def base_of(block: str) -> int:
    instances = (instance for layout in LAYOUTS for instance in layout.instances)
    return next(one.base for one in instances if one.name == block)


def divider(block: str, baud: int) -> int:
    """CLKDIV, by the formulas of the reference manual, sections 17.3.2.3 and 19.3.3."""
    clock_hz = 7_000_000 if block.startswith("LE") else 14_000_000 / 16
    unit = 8 if block.startswith("LE") else 64
    return round(256 * (clock_hz / baud - 1)) // unit * unit


@contextmanager
def echoing(
    echo: Image, block: str, location: int, serial: str, baud: int = 115_200
) -> Iterator[Efm32ggBoard]:
    board = Efm32ggBoard(echo, serial=serial)
    (route,) = parse_routes(serial)
    words = {"low_energy": block.startswith("LE"), "base": base_of(block), "location": location}
    words |= {"tx": route.tx, "rx": route.rx, "divider": divider(block, baud)}
    symbols = board.insight.symbols
    in_flash = symbols.labels["data_load"] - symbols.labels["data_start"]
    for name, word in words.items():
        address = symbols.variables[name].address + in_flash
        assert board.machine.poke(address, int(word).to_bytes(4, "little")) == 4
    board.kernel.advance_to(PS_PER_MS)
    yield board
    board.close()


@together(("block", "location", "serial"), PLACES)
def test_every_block_answers_at_every_location(
    block: str, location: int, serial: str, echo: Image
) -> None:
    with echoing(echo, block, location, serial) as board:
        assert [line.name for line in board.lines] == [block.lower()]
        port = board.serial()
        for byte in b"AZ~":
            port.write(bytes([byte]))
            assert port.read(1, 0.01) == bytes([byte + 1])


def test_is_silent_at_other_pins(echo: Image) -> None:
    with echoing(echo, "UART0", 0, "uart0@PE0,PE1") as board:
        port = board.serial()
        port.write(b"A")
        assert port.read(1, 0.01) == b""


def test_line_takes_the_rate_of_the_firmware(echo: Image) -> None:
    with echoing(echo, "UART1", 3, "uart1@PE2,PE3", baud=19_200) as board:
        port = board.serial()
        port.write(b"A")
        assert port.read(1, 0.01) == b"B"
        assert board.uart.form == board.uart.host_form
        assert board.uart.form.baud == pytest.approx(19_200, rel=0.003)


def test_host_with_a_rate_of_its_own_reads_garbage(echo: Image) -> None:
    with echoing(echo, "UART0", 1, "uart0@PE0,PE1") as board:
        line = HostLine(board.uart)
        line.form = LineFormat(38_400)
        board.uart.host_writes(b"A")
        board.kernel.advance_to(20 * PS_PER_MS)
        assert line.take(board.kernel.now) != b"B"


def test_several_lines_have_names_and_places() -> None:
    text = "uart0@PE0,PE1:./tty,leuart1@pa5,PA6:4000,USART1@PD0,PD1"
    assert parse_routes(text) == (
        SerialRoute("uart0", 64, 65, "./tty"),
        SerialRoute("leuart1", 5, 6, "4000"),
        SerialRoute("usart1", 48, 49),
    )
    assert parse_routes("") == ()


WRONG = {
    "uart0": r"'uart0' must be BLOCK@TX,RX\[:PATH\|PORT\], such as uart0@PE0,PE1:./tty$",
    "uart0@PE0": r"'uart0@PE0' must be BLOCK@TX,RX",
    "uart7@PE0,PE1": r"the part has no 'uart7'; it has usart0, usart1, usart2, uart0, uart1, leu",
    "uart1@PE0,PE1": r"TX,RX of uart1 are PC12,PC13 or PF10,PF11 or PB9,PB10 or PE2,PE3$",
    "uart0@PE1,PE0": r"TX,RX of uart0 are PF6,PF7 or PE0,PE1 or PA3,PA4 or PC14,PC15$",
    "uart0@PE0,PX1": r"^'PX1' is no pin",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_routes_are_one_line(text: str) -> None:
    with pytest.raises(ValueError, match=WRONG[text]):
        parse_routes(text)


def test_further_lines_are_beside_the_first(echo: Image) -> None:
    board = Efm32ggBoard(echo, serial="uart0@PE0,PE1,leuart1@PC6,PC7,usart2@PC2,PC3")
    assert [line.suffix for line in board.lines] == ["", ".leuart1", ".usart2"]
    board.close()


@pytest.mark.parametrize("second", ["uart0@PF6,PF7", "usart1@PC0,PC1"])
def test_a_block_and_a_pin_lead_to_one_line(second: str, echo: Image) -> None:
    first = "uart0@PE0,PE1" if "uart0" in second else "usart0@PC0,PC1"
    with pytest.raises(ValueError, match=rf"^serial {second}: us?art0 is led out already; leave"):
        Efm32ggBoard(echo, serial=f"{first},{second}")
