"""A device file's calls: what Linux's i2c-dev answers, and what goes over the bus."""

import errno
from collections.abc import Callable
from typing import Any

import pytest

from cubestack.emulator.i2cdev.adapter import FUNCTIONS, I2cAdapter
from cubestack.emulator.i2cdev.device_file import DeviceFile
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats import linux_i2c as linux

READ = int(linux.MessageFlag.READ)
LENGTH_FROM_DEVICE = READ | linux.MessageFlag.RECEIVE_LENGTH
Ask = Callable[[i2c_socket.Call, bytes], tuple[int, bytes]]


@pytest.fixture
def file(adapter: I2cAdapter) -> DeviceFile:
    file = DeviceFile(adapter)
    file.address = 0x1A
    return file


@pytest.fixture
def ask(file: DeviceFile, kernel: Any) -> Ask:
    """Does a call and waits for its end."""

    def call(call: i2c_socket.Call, body: bytes) -> tuple[int, bytes]:
        replies: list[bytes] = []
        file.perform(call, body, replies.append)
        while not replies:
            kernel.step()
        return i2c_socket.split_reply(replies[0])

    return call


def ioctl(ask: Ask, number: int, argument: int = 0) -> tuple[int, bytes]:
    return ask(i2c_socket.Call.IOCTL, i2c_socket.pack_ioctl(number, argument))


def rdwr(ask: Ask, *messages: linux.RdwrMessage) -> tuple[int, list[bytes]]:
    result, data = ask(i2c_socket.Call.RDWR, i2c_socket.pack_rdwr(messages))
    return result, i2c_socket.split_rdwr(messages, data) if result >= 0 else []


@pytest.mark.parametrize("number", [linux.Ioctl.SLAVE, linux.Ioctl.SLAVE_FORCE])
@pytest.mark.parametrize(
    ("ten_bit", "address", "result"),
    [(0, 0x7F, 0), (0, 0x80, -errno.EINVAL), (1, 0x3FF, 0), (1, 0x400, -errno.EINVAL)],
)
def test_slave_ioctl_sets_the_address_within_its_range(
    ask: Ask, file: DeviceFile, number, ten_bit, address, result
):
    ioctl(ask, linux.Ioctl.TENBIT, ten_bit)
    assert ioctl(ask, number, address) == (result, b"")
    assert file.address == (0x1A if result else address)


@pytest.mark.parametrize(
    ("number", "argument", "answer"),
    [
        *((number, 2**31 - 1, (0, b"")) for number in (linux.Ioctl.RETRIES, linux.Ioctl.TIMEOUT)),
        *((n, 2**31, (-errno.EINVAL, b"")) for n in (linux.Ioctl.RETRIES, linux.Ioctl.TIMEOUT)),
        *((number, 0, (-errno.ENOTTY, b"")) for number in (0x0700, 0x0709, 0x5401)),
        (linux.Ioctl.FUNCS, 0, (0, FUNCTIONS.to_bytes(8, "little"))),
    ],
)
def test_ioctl_answers_other_requests_as_linux(ask: Ask, number, argument, answer):
    assert ioctl(ask, number, argument) == answer


def test_timeout_is_in_units_of_ten_milliseconds(ask: Ask, adapter: I2cAdapter):
    """linux/i2c-dev.h; retries are a plain number."""
    ioctl(ask, linux.Ioctl.TIMEOUT, 3)
    ioctl(ask, linux.Ioctl.RETRIES, 4)
    assert (adapter.timeout_ps, adapter.retries) == (30 * 10**9, 4)


def test_device_file_write_then_read_returns_register_data(ask: Ask, registers):
    assert ask(i2c_socket.Call.WRITE, b"\x20\xaa\xbb") == (3, b"")
    assert ask(i2c_socket.Call.WRITE, b"\x1f") == (1, b"")
    assert ask(i2c_socket.Call.READ, i2c_socket.pack_read(4)) == (4, b"\x1f\xaa\xbb\x22")
    assert registers.log == [[0x20, 0xAA, 0xBB], -1, [0x1F], -1, 4, -1]


def test_transfers_longer_than_8192_bytes_are_truncated(ask: Ask, registers):
    result, data = ask(i2c_socket.Call.READ, i2c_socket.pack_read(2**63))
    assert (result, len(data)) == (8192, 8192)
    registers.pointer = -8191  # the first byte sets it, so nothing is refused
    registers.i2c_write = lambda byte: registers.log[-1].append(byte) or True
    assert ask(i2c_socket.Call.WRITE, bytes(9000)) == (8192, b"")
    assert len(registers.log[-2]) == 8192


def test_zero_length_transfer_is_a_probe(ask: Ask, registers):
    assert ask(i2c_socket.Call.WRITE, b"") == (0, b"")
    assert ask(i2c_socket.Call.READ, i2c_socket.pack_read(0)) == (0, b"")
    assert registers.log == [[], -1, 0, -1]


def test_device_file_returns_linux_errors_for_refused_bytes(ask: Ask, file: DeviceFile):
    assert ask(i2c_socket.Call.WRITE, b"\xf1\x00") == (-errno.EIO, b"")
    file.address = 0x30
    for ten_bit, code in ((0, -errno.ENXIO), (1, -errno.EOPNOTSUPP)):
        ioctl(ask, linux.Ioctl.TENBIT, ten_bit)
        assert ask(i2c_socket.Call.WRITE, b"\x00") == (code, b"")
        assert ask(i2c_socket.Call.READ, i2c_socket.pack_read(1)) == (code, b"")


def test_device_file_returns_the_error_numbers_of_the_chosen_driver(kernel, bus):
    file = DeviceFile(
        I2cAdapter(kernel, bus, address_errno=errno.EREMOTEIO, data_errno=errno.EBUSY)
    )
    replies: list[bytes] = []
    file.perform(i2c_socket.Call.READ, i2c_socket.pack_read(1), replies.append)
    file.address = 0x1A
    file.perform(i2c_socket.Call.WRITE, b"\xf1\x00", replies.append)
    kernel.run()
    assert [i2c_socket.split_reply(reply)[0] for reply in replies] == [
        -errno.EREMOTEIO,
        -errno.EBUSY,
    ]


def test_clock_stretching_delays_the_call_or_times_out(ask: Ask, kernel, registers):
    ask(i2c_socket.Call.READ, i2c_socket.pack_read(1))
    plain = kernel.now
    registers.busy_reads = 7
    ask(i2c_socket.Call.READ, i2c_socket.pack_read(1))
    assert kernel.now - plain == plain + 7 * 2_500_000
    registers.busy_reads = 10**9  # for ever
    assert ask(i2c_socket.Call.READ, i2c_socket.pack_read(1)) == (-errno.ETIMEDOUT, b"")


def test_rdwr_combines_messages_without_a_stop_between(ask: Ask, registers):
    messages = (
        linux.RdwrMessage(0x1A, 0, 2, b"\x10\x99"),
        linux.RdwrMessage(0x1A, 0, 1, b"\x10"),
        linux.RdwrMessage(0x1A, READ, 2),
        linux.RdwrMessage(0x1A, READ, 1),
    )
    assert rdwr(ask, *messages) == (4, [b"", b"", b"\x99\x11", b"\x12"])
    assert registers.log == [[0x10, 0x99], [0x10], 2, 1, -1]  # one stop


@pytest.mark.parametrize(
    ("messages", "code"),
    [
        ([], errno.EINVAL),
        ([linux.RdwrMessage(0x1A, READ, 1)] * 43, errno.EINVAL),
        ([linux.RdwrMessage(0x1A, READ, 8193)], errno.EINVAL),
        ([linux.RdwrMessage(0x1A, 0, 8193)], errno.EINVAL),
        ([linux.RdwrMessage(0x80, READ, 1)], errno.EINVAL),
        ([linux.RdwrMessage(0x1A, READ | 0x4000, 1)], errno.EOPNOTSUPP),
        ([linux.RdwrMessage(0x1A, READ | linux.MessageFlag.TEN_BIT, 1)], errno.EOPNOTSUPP),
        ([linux.RdwrMessage(0x1A, READ, 1), linux.RdwrMessage(0x30, READ, 1)], errno.ENXIO),
        ([linux.RdwrMessage(0x1A, 0, 2, b"\xf1\x00")], errno.EIO),
        *(
            ([linux.RdwrMessage(0x1A, LENGTH_FROM_DEVICE, length, first)], errno.EINVAL)
            for length, first in ((32, b"\1"), (33, b"\0"), (33, b"\2"), (0, b""))
        ),
        (  # a length of 0
            [
                linux.RdwrMessage(0x1A, 0, 1, b"\0"),
                linux.RdwrMessage(0x1A, LENGTH_FROM_DEVICE, 33, b"\1"),
            ],
            errno.EPROTO,
        ),
    ],
)
def test_rdwr_errors_have_the_linux_codes(ask: Ask, messages, code):
    assert rdwr(ask, *messages) == (-code, [])


def test_rdwr_block_read_takes_its_length_from_the_device(ask: Ask):
    messages = (
        linux.RdwrMessage(0x1A, 0, 1, b"\x05"),
        linux.RdwrMessage(0x1A, LENGTH_FROM_DEVICE, 33, b"\x01"),
        linux.RdwrMessage(0x1A, READ, 1),
    )
    assert rdwr(ask, *messages) == (3, [b"", bytes([5, 6, 7, 8, 9, 10]), b"\x0b"])


@pytest.mark.parametrize(
    ("direction", "size", "data"),
    [
        (2, linux.SmbusSize.BYTE_DATA, bytes(34)),
        (1, 9, bytes(34)),
        (1, linux.SmbusSize.BYTE_DATA, None),
        (1, linux.SmbusSize.I2C_BLOCK_DATA, bytes([33]) + bytes(33)),
        (0, linux.SmbusSize.I2C_BLOCK_DATA, bytes([33]) + bytes(33)),
        (0, linux.SmbusSize.BLOCK_DATA, bytes([33]) + bytes(33)),
        (0, linux.SmbusSize.BLOCK_PROCESS_CALL, bytes([33]) + bytes(33)),
    ],
)
def test_invalid_smbus_arguments_are_refused(ask: Ask, direction, size, data):
    body = i2c_socket.pack_smbus(linux.SmbusCall(direction, 0, size, data))
    assert ask(i2c_socket.Call.SMBUS, body) == (-errno.EINVAL, b"")


def test_smbus_reply_has_what_the_transaction_uses(ask: Ask):
    for size, count in ((linux.SmbusSize.BYTE_DATA, 1), (linux.SmbusSize.WORD_DATA, 2)):
        result, data = ask(
            i2c_socket.Call.SMBUS, i2c_socket.pack_smbus(linux.SmbusCall(1, 0x40, size, bytes(34)))
        )
        assert (result, len(data)) == (0, count)
    assert ask(
        i2c_socket.Call.SMBUS,
        i2c_socket.pack_smbus(linux.SmbusCall(0, 0x40, linux.SmbusSize.BYTE, None)),
    ) == (0, b"")


def test_pec_ioctl_switches_checksums(ask: Ask, registers):
    write = i2c_socket.pack_smbus(
        linux.SmbusCall(0, 0x40, linux.SmbusSize.BYTE_DATA, bytes([7]) + bytes(33))
    )
    ask(i2c_socket.Call.SMBUS, write)
    ioctl(ask, linux.Ioctl.PEC, 1)
    ask(i2c_socket.Call.SMBUS, write)
    assert [len(entry) for entry in registers.log if isinstance(entry, list)] == [2, 3]
    # Reading, the device's next byte is no checksum of those before it.
    read = i2c_socket.pack_smbus(linux.SmbusCall(1, 0x40, linux.SmbusSize.BYTE_DATA, bytes(34)))
    assert ask(i2c_socket.Call.SMBUS, read) == (-errno.EBADMSG, b"")


@pytest.mark.parametrize(
    "call",
    [i2c_socket.Call.IOCTL, i2c_socket.Call.RDWR, i2c_socket.Call.SMBUS, i2c_socket.Call.READ],
)
@pytest.mark.parametrize("body", [b"x", b"\xff" * 13])
def test_malformed_calls_raise_value_error(file: DeviceFile, call, body):
    with pytest.raises(ValueError, match=r"fields have|breaks off"):
        file.perform(call, body, lambda _reply: None)
