"""SMBus transactions: bytes on the wire as the specification draws them."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.i2cdev.smbus import Transaction, checksum
from cubestack.firmware_model.formats.linux_i2c import SmbusCall, SmbusSize

READ, WRITE = 1, 0
ADDRESS = 0x1A
BLOCK = bytes([3, 10, 11, 12]).ljust(34, b"\0")
Perform = Callable[..., bytes]


@pytest.fixture
def perform(kernel: Any, bus: Any) -> Perform:
    """Does a transaction; the caller's data afterwards."""

    def call(direction: int, command: int, size: SmbusSize, data: bytes = bytes(34), pec=False):
        transaction = Transaction(
            ADDRESS, SmbusCall(direction, command, size, data), with_checksum=pec
        )
        kernel.run(until=kernel.process(bus.transfer(transaction.messages)))
        return transaction.answer()

    return call


@pytest.mark.parametrize(
    ("direction", "size", "wire"),
    [
        (WRITE, SmbusSize.QUICK, [[], -1]),
        (READ, SmbusSize.QUICK, [0, -1]),
        (WRITE, SmbusSize.BYTE, [[0x20], -1]),
        (READ, SmbusSize.BYTE, [1, -1]),
        (WRITE, SmbusSize.BYTE_DATA, [[0x20, 3], -1]),
        (READ, SmbusSize.BYTE_DATA, [[0x20], 1, -1]),
        (WRITE, SmbusSize.WORD_DATA, [[0x20, 3, 10], -1]),
        (READ, SmbusSize.WORD_DATA, [[0x20], 2, -1]),
        (WRITE, SmbusSize.PROCESS_CALL, [[0x20, 3, 10], 2, -1]),
        (WRITE, SmbusSize.BLOCK_DATA, [[0x20, 3, 10, 11, 12], -1]),
        (READ, SmbusSize.BLOCK_DATA, [[0x20], 33, -1]),
        (WRITE, SmbusSize.BLOCK_PROCESS_CALL, [[0x20, 3, 10, 11, 12], 25, -1]),
        (WRITE, SmbusSize.I2C_BLOCK_DATA, [[0x20, 10, 11, 12], -1]),
        (READ, SmbusSize.I2C_BLOCK_DATA, [[0x20], 3, -1]),
        (READ, SmbusSize.I2C_BLOCK_BROKEN, [[0x20], 32, -1]),
    ],
)
def test_smbus_calls_have_their_i2c_bytes(perform: Perform, registers, direction, size, wire):
    registers.memory[0x24] = 24  # where a block process call goes on to read: its length
    perform(direction, 0x20, size, BLOCK)
    assert registers.log == wire


def test_smbus_reads_return_register_data(perform: Perform, registers):
    assert perform(READ, 0x41, SmbusSize.BYTE_DATA)[0] == 0x41
    assert perform(READ, 0x41, SmbusSize.WORD_DATA)[:2] == b"\x41\x42"
    assert perform(READ, 4, SmbusSize.BLOCK_DATA)[:5] == bytes([4, 5, 6, 7, 8])
    assert perform(READ, 0x41, SmbusSize.I2C_BLOCK_DATA, BLOCK)[:4] == bytes([3, 0x41, 0x42, 0x43])
    assert perform(READ, 0x41, SmbusSize.I2C_BLOCK_BROKEN)[:3] == bytes([32, 0x41, 0x42])
    registers.pointer = 9
    assert perform(READ, 0, SmbusSize.BYTE)[0] == 9


def test_i2c_block_of_zero_bytes_reads_nothing(perform: Perform, registers):
    assert perform(READ, 0x41, SmbusSize.I2C_BLOCK_DATA, bytes(34)) == bytes(34)
    assert registers.log == [[0x41], 0, -1]


def test_write_leaves_its_data_unchanged(perform: Perform):
    assert perform(WRITE, 0x41, SmbusSize.WORD_DATA, BLOCK) == BLOCK


def test_smbus_checksum_matches_the_crc_8_check_value():
    """CRC-8 of "123456789" with polynomial 7 and start 0, from the catalogue of CRC algorithms."""
    assert checksum(b"123456789") == 0xF4


@given(st.binary(max_size=40))
def test_checksum_over_data_and_checksum_is_zero(data):
    assert checksum([*data, checksum(data)]) == 0


@pytest.mark.parametrize("size", [SmbusSize.BYTE, SmbusSize.BYTE_DATA, SmbusSize.BLOCK_DATA])
def test_smbus_write_checksum_covers_address_and_data(perform: Perform, registers, size):
    perform(WRITE, 0x20, size, BLOCK, pec=True)
    *data, last = registers.log[0]
    assert checksum([ADDRESS << 1, *data, last]) == 0


@pytest.mark.parametrize("size", [SmbusSize.BYTE_DATA, SmbusSize.WORD_DATA, SmbusSize.BLOCK_DATA])
@pytest.mark.parametrize("flip", [0, 1])
def test_read_checksum_is_checked(perform: Perform, registers, size, flip):
    count = {SmbusSize.BYTE_DATA: 1, SmbusSize.WORD_DATA: 2, SmbusSize.BLOCK_DATA: 5}[size]
    sent = [4, 5, 6, 7, 8][:count]
    seen = [ADDRESS << 1, 4, ADDRESS << 1 | 1, *sent]
    registers.memory[4 + count] = checksum(seen) ^ flip
    if flip:
        with pytest.raises(OSError, match="packet error code"):
            perform(READ, 4, size, pec=True)
    else:
        assert perform(READ, 4, size, pec=True)[:count] == bytes(sent)


@pytest.mark.parametrize("size", [SmbusSize.QUICK, SmbusSize.I2C_BLOCK_DATA])
def test_smbus_quick_and_i2c_block_have_no_checksum(perform: Perform, registers, size):
    perform(WRITE, 0x20, size, BLOCK)
    plain = list(registers.log)
    perform(WRITE, 0x20, size, BLOCK, pec=True)
    assert registers.log == plain * 2
