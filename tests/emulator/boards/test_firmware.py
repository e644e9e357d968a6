from typing import Any

import pytest

from cubestack.emulator.boards.firmware import FRAMES, CameraWire, Core, SerialWire, SlaveWire
from cubestack.emulator.bus.line_format import FASTEST_BAUD, LineFormat
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

SDA, TX, RX = 0x21, 0x33, 0x34
CAMERA = 0x5D


class Machine:
    """Keeps what is given to it; ``replies`` are a slave's answers."""

    def __init__(self) -> None:
        self.given: list[tuple[Any, ...]] = []
        self.memory: dict[int, int] = {}
        self.values = {"r0": 0b1000, "primask": 0}
        self.replies: list[int | None] = []

    def peek(self, address: int, count: int) -> bytes:
        return self.memory[address].to_bytes(count, "little")

    def register(self, name: str) -> int:
        return self.values[name]

    def set_register(self, name: str, value: int) -> None:
        self.values[name] = value

    def __getattr__(self, name: str) -> Any:
        def take(*arguments: Any) -> int | None:
            self.given.append((name, *arguments))
            return self.replies.pop(0) if name.startswith("i2c_slave") and self.replies else None

        return take


class Processor:
    def __init__(self) -> None:
        self.machine = Machine()
        self.calls: list[str] = []

    def change_inputs(self, act: Any) -> None:
        self.calls.append("give")
        act()

    def catch_up(self) -> None:
        self.calls.append("catch_up")

    def wake(self) -> None:
        self.calls.append("wake")


@pytest.fixture
def processor() -> Any:
    return Processor()


class Bus:
    def __init__(self) -> None:
        self.machine: Any = Machine()
        self.camera = Mt9m001(SkyScene.pointing(80.0, 0.0))
        self.wire = CameraWire(self.camera, SDA)

    def say(self, kind: OutgoingKind, value: int = 0, unit: int = SDA << 8 | 1) -> Any:
        del self.machine.given[:]
        self.wire.handle(self.machine, Outgoing(kind, unit, value, 0, 5))
        assert len(self.machine.given) <= 1
        if not self.machine.given:
            return None
        name, its_unit, *rest = self.machine.given[0]
        assert (name, its_unit) == ("i2c_answer", unit & 0xFF)
        return tuple(rest)

    def read(self, count: int) -> list[int]:
        assert self.say(OutgoingKind.I2C_START, CAMERA << 1 | 1) == (True,)
        found = [self.say(OutgoingKind.I2C_READ) for _ in range(count)]
        assert all(acknowledged for acknowledged, _ in found)
        self.say(OutgoingKind.I2C_STOP)
        return [byte for _, byte in found]

    def write(self, *data: int, stop: bool = True) -> list[tuple[bool]]:
        answers = [self.say(OutgoingKind.I2C_START, CAMERA << 1)]
        answers += [self.say(OutgoingKind.I2C_WRITE, byte) for byte in data]
        if stop:
            assert self.say(OutgoingKind.I2C_STOP) is None
        return answers


def test_i2c_master_reads_and_writes_camera_registers() -> None:
    bus = Bus()
    assert bus.write(0x09, 0x12, 0x34) == [(True,)] * 4
    bus.write(0x09)
    assert bus.read(3) == [0x12, 0x34, 0x00]  # and half of the next register
    # A repeated start ends what was written, too.
    bus.write(0x09, stop=False)
    assert bus.read(2) == [0x12, 0x34]
    bus.write(0x00)
    assert bus.read(2) == [0x84, 0x31]
    assert bus.read(1) == [bus.camera.registers.peek(1) >> 8]


def test_write_takes_effect_once_at_its_end() -> None:
    bus = Bus()
    bus.write(0x09, 0x55, 0xAA, stop=False)
    assert bus.camera.registers.peek(9) == 0x0419
    bus.say(OutgoingKind.I2C_STOP)
    assert bus.camera.registers.peek(9) == 0x55AA
    bus.camera.registers.store("SHUTTER_WIDTH", 7)
    bus.say(OutgoingKind.I2C_STOP)
    assert bus.camera.registers.peek(9) == 7


def test_other_addresses_and_an_unpowered_camera_do_not_answer() -> None:
    bus = Bus()
    for address_byte in (0x40, 0x41):
        assert bus.say(OutgoingKind.I2C_START, address_byte) == (False,)
    assert bus.say(OutgoingKind.I2C_WRITE, 1) == (False,)
    bus.say(OutgoingKind.I2C_STOP)
    assert bus.say(OutgoingKind.PIN, 1) is None
    bus.camera.power(False, 0)
    assert bus.say(OutgoingKind.I2C_START, CAMERA << 1) == (False,)
    assert bus.say(OutgoingKind.I2C_START, CAMERA << 1 | 1) == (False,)
    assert bus.say(OutgoingKind.I2C_READ) == (True, 0xFF)  # the pulled-up line


def test_master_on_pins_without_a_slave_is_not_acknowledged() -> None:
    bus = Bus()
    for unit in ((SDA + 1) << 8, 1):
        assert bus.say(OutgoingKind.I2C_START, CAMERA << 1, unit=unit) == (False, 0xFF)
        assert bus.say(OutgoingKind.I2C_WRITE, 1, unit=unit) == (False, 0xFF)
        assert bus.say(OutgoingKind.I2C_READ, unit=unit) == (False, 0xFF)
        assert bus.say(OutgoingKind.I2C_STOP, unit=unit) is None
    assert bus.say(OutgoingKind.PIN, 1, unit=1) is None


class Line:
    def __init__(self, processor: Any) -> None:
        self.kernel = Kernel()
        self.wire = SerialWire(processor, TX, RX)
        self.uart = Uart(
            self.kernel, 9600, self.wire.uart_byte, self.wire.uart_silence, silence_bytes=10
        )
        self.wire.connect(self.uart)
        self.memory = processor.machine.memory
        self.memory[FRAMES[0][0]] = 0x1005  # 8N1

    def send(self, byte: int, bits: int, baud: float, unit: int = 0, pin: int = TX) -> None:
        one = Outgoing(OutgoingKind.UART, pin << 8 | unit, byte, round(bits * PS_PER_S / baud), 0)
        self.wire.sent(one)


@pytest.mark.parametrize(
    ("frame", "data", "parity", "stops"),
    [
        (0x1005, 8, "N", 1),
        (0x1004, 7, "N", 1),
        (0x1002, 5, "N", 1),
        (0x1001, 5, "N", 1),  # four bits are five of a serial line
        (0x1006, 8, "N", 1),  # and nine are eight
        (0x1205, 8, "E", 1),
        (0x1305, 8, "O", 1),
        (0x0005, 8, "N", 1),
        (0x2005, 8, "N", 1.5),
        (0x3305, 8, "O", 2),
    ],
)
def test_usart_frame_register_sets_the_line_format(
    processor: Any, frame: int, data: int, parity: Any, stops: float
) -> None:
    """EFM32GG Reference Manual, USART_FRAME: DATABITS, PARITY, STOPBITS."""
    line = Line(processor)
    line.memory[FRAMES[0][0]] = frame
    expected = LineFormat(19200, data, parity, stops)
    line.send(0x41, expected.bits, 19200)
    assert line.uart.form == expected
    assert line.uart.byte_ps == expected.character_ps


@pytest.mark.parametrize(
    ("control", "parity", "stops"),
    [(0, "N", 1), (0b10000, "N", 2), (0b01000, "E", 1), (0b11100, "O", 2), (0b00010, "N", 1)],
)
def test_leuart_control_register_sets_the_line_format(
    processor: Any, control: int, parity: Any, stops: float
) -> None:
    """LEUART_CTRL: DATABITS, PARITY, STOPBITS."""
    line = Line(processor)
    unit = next(n for n, (_, layout) in enumerate(FRAMES) if layout.name.startswith("LEUART"))
    line.memory[FRAMES[unit][0]] = control
    expected = LineFormat(4800, 8, parity, stops)
    line.send(1, expected.bits, 4800, unit)
    assert line.uart.form == expected


@pytest.mark.parametrize(
    ("baud", "taken"),
    [
        (9600, 9600),
        (9695, 9600),
        (9505, 9600),
        (9697, 9697),
        (9503, 9503),
        (115_900, 115_200),
        (117_000, 117_000),
        (1e9, FASTEST_BAUD),
    ],
)
def test_nearby_rate_snaps_to_host_or_board_rate(processor: Any, baud: float, taken: int) -> None:
    line = Line(processor)
    line.uart.host_form = LineFormat(115_200)
    line.send(0x41, 10, baud)
    assert line.uart.form.baud == pytest.approx(taken, abs=1)


def test_bytes_at_other_pins_are_ignored(processor: Any) -> None:
    line = Line(processor)
    line.send(0x41, 10, 9600, pin=TX + 1)
    assert line.uart.backlog == 0
    line.send(0x141, 10, 9600)
    assert line.uart.backlog == 1


def test_bytes_are_received_at_the_line_s_rate(processor: Any) -> None:
    line = Line(processor)
    line.uart.host_writes(b"\xa5")
    line.kernel.advance_to(PS_PER_S)
    line.wire.framing_error(0)
    rate = 9600 << 8
    received = ("uart_receive", 0x100 | RX)
    assert processor.machine.given == [(*received, 0xA5, rate), (*received, 0, rate | 1)]
    assert processor.calls == ["give", "give"]


def test_clock_stretching_slave_is_polled_for_the_same_byte(processor: Any) -> None:
    slave, machine, unit = SlaveWire(processor, SDA), processor.machine, 0x100 | SDA
    machine.replies += [None, None, 1, 1, 0, 0x5A]
    assert [slave.i2c_address(0x1A, True) for _ in range(3)] == [None, None, True]
    assert slave.i2c_address(0x1A, False) is True
    assert slave.i2c_write(7) is False
    assert slave.i2c_read() == 0x5A
    assert machine.given == [
        ("i2c_slave_start", unit, 0x35),
        ("i2c_slave_poll", unit),
        ("i2c_slave_poll", unit),
        ("i2c_slave_start", unit, 0x34),
        ("i2c_slave_write", unit, 7),
        ("i2c_slave_read", unit),
    ]
    assert processor.calls == ["catch_up", "wake"] * 6


def test_i2c_stop_ends_the_polling_of_a_byte(processor: Any) -> None:
    slave, machine, unit = SlaveWire(processor, SDA), processor.machine, 0x100 | SDA
    machine.replies += [None]
    assert slave.i2c_write(7) is None
    slave.i2c_stop()
    slave.i2c_read()
    assert machine.given[1:] == [("i2c_slave_stop", unit), ("i2c_slave_read", unit)]


def test_core_register_bits_can_be_flipped(processor: Any) -> None:
    core = Core(processor)
    assert core.registers["r0"] == core.registers["pc"] == core.registers["xpsr"] == 32
    widths = {name: core.registers[name] for name in ("primask", "basepri", "faultmask", "control")}
    assert widths == {"primask": 1, "basepri": 8, "faultmask": 1, "control": 2}
    assert "sp" not in core.registers  # which is MSP or PSP
    for bit, expected in ((0, 0b1001), (3, 0b0001), (31, 1 << 31 | 1)):
        core.flip("r0", bit)
        assert processor.machine.values["r0"] == expected
    assert processor.calls == ["give"] * 3
