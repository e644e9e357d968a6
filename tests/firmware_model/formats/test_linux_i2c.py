"""Numbers of Linux's I2C interface against smbus2's, and packed calls there and back."""

import contextlib
import ctypes
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from smbus2 import smbus2

from cubestack.firmware_model.formats import linux_i2c as table

U8, U16, U32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))


def test_i2c_constants_equal_those_of_smbus2():
    for number in table.Ioctl:
        assert number == getattr(smbus2, f"I2C_{number.name}", number)
    assert table.Function.I2C == smbus2.I2cFunc.I2C
    for name, function in table.Function.__members__.items():  # those of two bits too
        if name != "I2C":
            assert function == smbus2.I2cFunc[f"SMBUS_{name}".replace("PROCESS", "PROC")]
    for size in set(table.SmbusSize) - {table.SmbusSize.I2C_BLOCK_BROKEN}:
        assert size == getattr(smbus2, f"I2C_SMBUS_{size.name}".replace("PROCESS", "PROC"))
    assert table.MessageFlag.READ == smbus2.I2C_M_RD
    assert table.MessageFlag.TEN_BIT == 0x0010  # I2C_M_TEN in Linux's uapi/linux/i2c.h
    assert table.MAX_BLOCK_BYTES == smbus2.I2C_SMBUS_BLOCK_MAX
    assert ctypes.sizeof(smbus2.union_i2c_smbus_data) == table.SMBUS_DATA_BYTES


messages = st.builds(table.RdwrMessage, U16, U16, U16, st.binary(max_size=40))


@given(st.lists(messages, max_size=5))
def test_rdwr_messages_round_trip(wanted):
    assert table.unpack_rdwr(table.pack_rdwr(wanted)) == wanted


@given(U8, U8, U32, st.none() | st.binary(min_size=34, max_size=34))
def test_smbus_calls_round_trip(direction, command, size, data):
    call = table.SmbusCall(direction, command, size, data)
    assert table.unpack_smbus(table.pack_smbus(call)) == call


@given(st.integers(0, 2**64 - 1), st.sampled_from(table.Call), st.binary())
def test_requests_round_trip(key, call, body):
    assert table.split_request(table.request(key, call, body)) == (key, call, body)


@given(st.integers(-(2**31), 2**31 - 1), st.binary())
def test_replies_round_trip(result, data):
    assert table.split_reply(table.reply(result, data)) == (result, data)


@given(st.binary(max_size=60))
def test_arbitrary_bytes_parse_to_a_request_or_raise_value_error(data):
    for read in (
        table.split_request,
        table.split_reply,
        table.unpack_ioctl,
        table.unpack_rdwr,
        table.unpack_smbus,
        table.unpack_read,
    ):
        with contextlib.suppress(ValueError):
            read(data)


def test_split_rdwr_assigns_reply_data_to_the_reading_messages():
    read, block = table.MessageFlag.READ, table.MessageFlag.RECEIVE_LENGTH
    wanted = [
        table.RdwrMessage(1, 0, 2, b"xx"),
        table.RdwrMessage(1, read, 3),
        table.RdwrMessage(1, read | block, 40, b"\2"),
        table.RdwrMessage(1, read, 1),
    ]
    data = b"abc" + b"\2defZ"
    assert table.split_rdwr(wanted, data) == [b"", b"abc", b"\2def", b"Z"]


def test_socket_path_is_in_a_folder_of_the_user(monkeypatch, tmp_path: Path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert table.socket_path(7) == tmp_path / "cubestack" / "i2c-7"
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "missing"))
    assert table.socket_path(7).name == "i2c-7"
    assert table.socket_path(7).parent.name.startswith("cubestack-")


@pytest.mark.parametrize(("size", "count"), [(0, 34), (1, 1), (2, 1), (3, 2), (4, 2), (5, 34)])
def test_smbus_sizes_have_the_linux_data_lengths(size, count):
    assert table.smbus_data_bytes(size) == count
