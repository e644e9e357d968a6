"""Numbers of Linux's I2C interface against smbus2's."""

import ctypes

import pytest
from smbus2 import smbus2

from cubestack.firmware_model.formats import linux_i2c as table


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


@pytest.mark.parametrize(("size", "count"), [(0, 34), (1, 1), (2, 1), (3, 2), (4, 2), (5, 34)])
def test_smbus_sizes_have_the_linux_data_lengths(size, count):
    assert table.smbus_data_bytes(size) == count
