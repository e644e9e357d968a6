"""In-process links: waiting runs the simulation, as far as needed and no further."""

import errno

import pytest
from smbus2 import i2c_msg

from cubestack.emulator.bus.i2c import I2cBus, I2cError
from cubestack.emulator.i2cdev.direct import DirectI2c
from cubestack.emulator.ports.direct import DirectSerial
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.linux_i2c import Call, Ioctl, pack_ioctl, pack_read

BYTE = 10_000_000


@pytest.fixture
def serial(device) -> DirectSerial:
    return DirectSerial(device.kernel, device.uart)


def test_answer_comes_when_the_wire_delivers_it(device, serial):
    device.echoes = True
    serial.write(b"ab")
    assert serial.read(10, 1.0) == b"a"
    assert device.kernel.now == 2 * BYTE
    assert serial.read(10, 1.0) == b"b"
    assert device.kernel.now == 3 * BYTE


def test_read_returns_what_has_arrived_up_to_its_limit(device, serial):
    device.uart.send(b"abcdef")
    device.advance(4)
    assert serial.read(3, 1.0) == b"abc"
    assert serial.read(3, 1.0) == b"d"
    assert serial.read(3, 1.0) == b"e"
    assert device.kernel.now == 5 * BYTE


def test_nothing_comes(device, serial):
    assert serial.read(10, 0.5) == b""
    assert device.kernel.now == PS_PER_S // 2


@pytest.mark.parametrize(("timeout_s", "answer"), [(9e-6, b""), (10e-6, b"x")])
def test_byte_at_the_timeout(device, serial, timeout_s, answer):
    device.uart.send(b"x")
    assert serial.read(10, timeout_s) == answer
    assert device.kernel.now == round(timeout_s * PS_PER_S)


@pytest.mark.parametrize("timeout_s", [0.0, -1.0])
def test_no_timeout_does_not_wait(device, serial, timeout_s):
    device.uart.send(b"x")
    assert serial.read(10, timeout_s) == b""
    assert device.kernel.now == 0
    device.advance(1)
    assert serial.read(10, timeout_s) == b"x"


def test_other_events_do_not_end_a_read(device, serial):
    for time in range(1, 1000):
        device.kernel.timeout(time * BYTE // 7)
    device.uart.send(bytes(99))
    device.kernel.timeout(0).callbacks.append(lambda _event: device.uart.send(b"!"))
    received = b""
    while not received.endswith(b"!"):
        received += serial.read(10, 1.0)
    assert device.kernel.now == 100 * BYTE


def test_closed_link_hears_nothing(device, serial):
    serial.close()
    device.uart.send(b"x")
    assert serial.read(10, 1.0) == b""


class Memory:
    """A target with a register pointer."""

    def __init__(self) -> None:
        self.registers = bytearray(range(0x40, 0x50))
        self.pointer = 0
        self._first = True

    def i2c_start(self, read: bool) -> None:
        self._first = not read

    def i2c_write(self, byte: int) -> bool:
        if self._first:
            self.pointer = byte
        elif self.pointer < len(self.registers):
            self.registers[self.pointer] = byte
            self.pointer += 1
        self._first = False
        return self.pointer < len(self.registers)

    def i2c_read(self) -> int:
        self.pointer += 1
        return self.registers[self.pointer - 1]

    def i2c_stop(self) -> None:
        pass


@pytest.fixture
def memory() -> Memory:
    return Memory()


@pytest.fixture
def i2c(memory) -> DirectI2c:
    kernel = Kernel()
    bus = I2cBus(kernel)
    bus.attach(0x1A, memory)
    return DirectI2c(kernel, bus)


def test_smbus2_messages(i2c, memory):
    i2c.i2c_rdwr(i2c_msg.write(0x1A, [2, 0xAA, 0xBB]))
    assert memory.registers[2:4] == b"\xaa\xbb"
    write, read = i2c_msg.write(0x1A, [1]), i2c_msg.read(0x1A, 4)
    i2c.i2c_rdwr(write, read)
    assert bytes(read) == b"\x41\xaa\xbb\x44"
    assert list(read) == [0x41, 0xAA, 0xBB, 0x44]
    assert bytes(write) == b"\x01"


def test_every_byte_value_survives(i2c, memory):
    memory.registers[:] = bytes(range(240, 256))
    i2c.i2c_rdwr(i2c_msg.write(0x1A, b"\0"))
    read = i2c_msg.read(0x1A, 16)
    i2c.i2c_rdwr(read)
    assert bytes(read) == bytes(range(240, 256))


def test_missing_device_is_an_os_error(i2c):
    with pytest.raises(OSError, match="0x30") as raised:
        i2c.i2c_rdwr(i2c_msg.read(0x30, 1))
    assert isinstance(raised.value, I2cError)
    assert raised.value.errno == errno.ENXIO


def test_bus_works_after_a_refused_byte(i2c, memory):
    with pytest.raises(I2cError, match="refused byte 0x63"):
        i2c.i2c_rdwr(i2c_msg.write(0x1A, [99]))
    i2c.i2c_rdwr(i2c_msg.write(0x1A, [0, 7]))
    assert memory.registers[0] == 7


def test_ten_bit_addresses_are_refused(i2c):
    message = i2c_msg.write(0x1A, [1])
    message.flags |= 0x0010
    with pytest.raises(OSError, match="flags 0x0010") as raised:
        i2c.i2c_rdwr(message)
    assert raised.value.errno == errno.EOPNOTSUPP


def test_no_messages_are_a_bare_stop(i2c):
    i2c.i2c_rdwr()


def test_waiting_passes_virtual_time():
    kernel = Kernel()
    DirectI2c(kernel, I2cBus(kernel)).wait(0.25)
    assert kernel.now == PS_PER_S // 4


def test_calls_of_a_device_file(i2c, memory):
    assert i2c.call(Call.IOCTL, pack_ioctl(Ioctl.SLAVE, 0x1A)) == (0, b"")
    assert i2c.call(Call.WRITE, b"\x02") == (1, b"")
    assert i2c.call(Call.READ, pack_read(3)) == (3, b"\x42\x43\x44")
    assert i2c.call(Call.IOCTL, pack_ioctl(Ioctl.SLAVE, 0x30)) == (0, b"")
    assert i2c.call(Call.READ, pack_read(3)) == (-errno.ENXIO, b"")
    i2c.close()
