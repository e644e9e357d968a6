"""The host's end of the line: every byte once, in order, never before its time."""

import errno
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from smbus2 import i2c_msg

from cubestack.emulator.bus.i2c import I2cBus, I2cError
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.i2cdev.direct import DirectI2c
from cubestack.emulator.ports.line import DirectSerial, HostLine
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.i2c_socket import Call, pack_ioctl, pack_read
from cubestack.firmware_model.formats.linux_i2c import Ioctl
from cubestack.firmware_model.interface.codec.frames import (
    BACK,
    END,
    FrameDecoder,
    FrameEvent,
    encode_frame,
)

from ..bus.ends import Memory
from .conftest import ALL_BYTES

BYTE = 10_000_000


def make() -> tuple[Kernel, Uart, HostLine]:
    kernel = Kernel()
    uart = Uart(kernel, 1_000_000, lambda _byte: None, lambda: None, silence_bytes=100)
    return kernel, uart, HostLine(uart)


@given(
    st.lists(st.binary(max_size=6), max_size=5),
    st.lists(st.tuples(st.integers(0, 3 * BYTE), st.none() | st.integers(0, 4)), max_size=30),
)
def test_receives_in_any_chunk_size(blocks, takes):
    """Oracle: byte i of an unbroken stream arrives after i + 1 byte times."""
    _, uart, line = make()
    for block in blocks:
        uart.send(block)
    sent, taken, now = b"".join(blocks), b"", 0
    for step, limit in takes:
        now += step
        arrived = min(len(sent), now // BYTE)
        for count in range(1, len(sent) + 2):
            expected_ps = min(len(taken) + count, len(sent)) * BYTE
            assert line.arrival_ps(count) == (None if taken == sent else expected_ps)
        got = line.take(now, limit)
        expected = arrived - len(taken) if limit is None else min(arrived - len(taken), limit)
        assert len(got) == expected
        taken += got
    assert taken + line.take(10**12) == sent


def test_unplugged_line_receives_nothing():
    kernel, uart, line = make()
    uart.send(b"before")
    line.unplug()
    uart.send(b"after")
    assert line.take(10**12) == b""
    kernel.run()


def test_newer_host_line_replaces_the_older():
    _, uart, older = make()
    newer = HostLine(uart)
    uart.send(b"x")
    older.unplug()  # which is not plugged in any more
    uart.send(b"y")
    assert older.take(10**12) == b""
    assert newer.take(10**12) == b"xy"


@pytest.fixture
def serial(device) -> DirectSerial:
    return DirectSerial(device.kernel, device.uart)


def test_answer_is_read_when_its_wire_time_has_passed(device, serial):
    device.answers = 1
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


def test_read_times_out_without_data(device, serial):
    assert serial.read(10, 0.5) == b""
    assert device.kernel.now == PS_PER_S // 2


@pytest.mark.parametrize(("timeout_s", "answer"), [(9e-6, b""), (10e-6, b"x")])
def test_byte_at_the_timeout_is_returned(device, serial, timeout_s, answer):
    device.uart.send(b"x")
    assert serial.read(10, timeout_s) == answer
    assert device.kernel.now == round(timeout_s * PS_PER_S)


@pytest.mark.parametrize("timeout_s", [0.0, -1.0])
def test_read_without_a_time_out_returns_immediately(device, serial, timeout_s):
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


def frames_in(
    whole: bool, sent: list[tuple[int, bytes]], others: list[int], timeout_s: float
) -> list[tuple[bytes | None, int]]:
    """Payloads of all frames and the times at which a host has them, read by byte or ``whole``."""
    kernel, uart, _ = make()
    serial = DirectSerial(kernel, uart)
    for after, data in sent:
        kernel.timeout(after).callbacks.append(lambda _event, data=data: uart.send(data))
    for after in others:
        kernel.timeout(after)
    read = partial(serial.read_on, BACK) if whole else serial.read
    decoder, found, failures = FrameDecoder(20), [], 0
    while failures < 3:
        data = read(64, timeout_s)
        failures += not data
        for byte in data:
            if decoder.feed(byte) is FrameEvent.FRAME:
                found.append((decoder.payload, kernel.now))
    return [*found, (None, kernel.now)]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 60 * BYTE),
            st.binary(max_size=6).map(encode_frame)
            | st.lists(st.sampled_from([0x1F, 0x7F, 0xFF, 0]), max_size=8).map(bytes),
        ),
        max_size=8,
    ),
    st.lists(st.integers(0, 60 * BYTE), max_size=20),
    st.sampled_from([0.0, 5e-6, 2e-5, 1e-3]),
)
def test_whole_frames_are_read_when_a_host_by_byte_has_them(sent, others, timeout_s):
    whole = frames_in(True, sent, others, timeout_s)
    assert whole == frames_in(False, sent, others, timeout_s)


def conversation(
    at_once: bool, turns: list[tuple[bytes, int]], others: list[int], answers: int
) -> list[tuple[Any, ...]]:
    """What events and a host see while it writes and reads in turn: received bytes, times, data."""
    kernel, seen, received = Kernel(), [], bytearray()

    def on_byte(byte: int) -> None:
        received.append(byte)
        if byte == END:
            seen.append((len(received), kernel.now))
            uart.send(bytes(answers))

    def on_silence() -> None:
        seen.append((len(received), kernel.now, "silence"))

    uart = Uart(kernel, 1_000_000, on_byte, on_silence, silence_bytes=3)
    serial = DirectSerial(kernel, uart)
    if at_once:
        uart.frame_end = lambda: END
    for after in others:
        event = kernel.timeout(after)
        event.callbacks.append(lambda _event: seen.append((len(received), kernel.now)))
    for data, wait_ps in turns:
        serial.write(data)
        answer = serial.read(64, wait_ps / PS_PER_S)
        seen.append((answer, len(received), kernel.now, uart.host_backlog))
    return seen


@given(
    st.lists(
        st.tuples(
            st.lists(st.sampled_from([0, 1, END]), max_size=7).map(bytes),
            st.integers(0, 12).map(lambda count: count * BYTE // 2),
        ),
        max_size=8,
    ),
    st.lists(st.integers(0, 100).map(lambda count: count * BYTE // 4), max_size=12),
    st.integers(0, 4),
)
def test_bytes_that_one_event_delivers_are_seen_as_if_they_came_alone(turns, others, answers):
    one_by_one = conversation(False, turns, others, answers)
    assert conversation(True, turns, others, answers) == one_by_one


def test_frame_of_a_host_that_waits_is_one_event(device, serial):
    device.uart.frame_end = lambda: END
    serial.write(bytes(20) + bytes([END]))
    before = next(device.kernel._eid)
    serial.read(10, 1e-3)
    assert device.received == bytes(20) + bytes([END])
    assert next(device.kernel._eid) - before < 10


def test_observer_of_steps_sees_every_byte(device, serial):
    device.uart.send(b"abcdef")
    steps = []
    vars(device.kernel)["step"] = lambda: (steps.append(0), Kernel.step(device.kernel))
    assert serial.read_on(b"f", 64, 1.0) == b"a"
    assert steps
    del vars(device.kernel)["step"]
    assert serial.read_on(b"e", 64, 1.0) == b"bcde"
    assert device.kernel.now == 5 * BYTE


def test_closed_link_receives_nothing(device, serial):
    serial.close()
    device.uart.send(b"x")
    assert serial.read(10, 1.0) == b""


@pytest.fixture
def memory() -> Memory:
    return Memory(refuse=99)


@pytest.fixture
def i2c(memory) -> DirectI2c:
    kernel = Kernel()
    bus = I2cBus(kernel)
    bus.attach(0x1A, memory)
    return DirectI2c(kernel, bus)


def test_direct_i2c_accepts_smbus2_messages(i2c, memory):
    write, read = i2c_msg.write(0x1A, [2, 0xAA]), i2c_msg.read(0x1A, 256)
    i2c.i2c_rdwr(write, read)
    assert memory.calls == ["write", 2, 0xAA, "read", "stop"]
    assert (bytes(write), bytes(read), list(read)) == (b"\2\xaa", ALL_BYTES, [*range(256)])


def test_bus_works_after_errors_of_the_system(i2c, memory):
    with pytest.raises(OSError, match="0x30") as raised:
        i2c.i2c_rdwr(i2c_msg.read(0x30, 1))
    assert isinstance(raised.value, I2cError)
    assert raised.value.errno == errno.ENXIO
    with pytest.raises(I2cError, match="did not acknowledge byte 0x63"):
        i2c.i2c_rdwr(i2c_msg.write(0x1A, [99]))
    i2c.i2c_rdwr()  # a bare stop
    i2c.i2c_rdwr(i2c_msg.write(0x1A, [0, 7]))
    assert memory.calls[-4:] == ["write", 0, 7, "stop"]


def test_ten_bit_addresses_are_refused(i2c):
    message = i2c_msg.write(0x1A, [1])
    message.flags |= 0x0010
    with pytest.raises(OSError, match="flags 0x0010") as raised:
        i2c.i2c_rdwr(message)
    assert raised.value.errno == errno.EOPNOTSUPP


def test_waiting_passes_virtual_time():
    kernel = Kernel()
    DirectI2c(kernel, I2cBus(kernel)).wait(0.25)
    assert kernel.now == PS_PER_S // 4


def test_direct_i2c_port_accepts_device_file_calls(i2c, memory):
    assert i2c.call(Call.IOCTL, pack_ioctl(Ioctl.SLAVE, 0x1A)) == (0, b"")
    assert i2c.call(Call.WRITE, b"\x02") == (1, b"")
    assert i2c.call(Call.READ, pack_read(3)) == (3, b"\x00\x01\x02")
    assert i2c.call(Call.IOCTL, pack_ioctl(Ioctl.SLAVE, 0x30)) == (0, b"")
    assert i2c.call(Call.READ, pack_read(3)) == (-errno.ENXIO, b"")
    i2c.close()
