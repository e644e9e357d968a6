"""The FPGAs' registers on I2C: one table, whose commands are those of the parallel board."""

import pytest

from cubesense_fpga_i2c.register_table import (
    ADDRESSES,
    GROUP_ADDRESS,
    I2C_COMMANDS,
    REGISTER_BITS,
    REGISTERS,
    RESET_COMMAND,
    CommandBits,
    PointerBits,
    Register,
    StatusBits,
    command_byte,
    command_of,
    pointer_bytes,
)
from cubestack.firmware_model.interface.cubesense.fpga import (
    COMMANDS,
    FULL_SIZE,
    Action,
    Actions,
    actions,
)

STANDBY = Actions(Action.STANDBY, Action.STANDBY)
BOTH_READ = Actions(Action.READ, Action.READ)


def test_i2c_addresses_are_distinct_and_not_reserved() -> None:
    addresses = {*ADDRESSES.values(), GROUP_ADDRESS}
    assert len(addresses) == 3
    assert all(0x08 <= address <= 0x77 for address in addresses)


def test_each_register_is_declared_once() -> None:
    assert [register.address for register in REGISTERS] == sorted(Register)
    assert [register.name for register in REGISTERS] == [register.name for register in Register]
    assert max(Register) == (1 << REGISTER_BITS) - 1 == Register.DATA


def test_pointer_and_data_are_adjacent() -> None:
    """So that one transfer sets the address and the next byte is the pixel."""
    names = [Register.POINTER_HIGH, Register.POINTER_MID, Register.POINTER_LOW, Register.DATA]
    assert [*range(names[0], names[0] + 4)] == names
    assert Register.SUN_LOW == Register.SUN_MID + 1 == Register.SUN_HIGH + 2


@pytest.mark.parametrize("bits", [StatusBits, CommandBits])
def test_status_and_command_bits_are_the_lowest_four(bits: type[StatusBits | CommandBits]) -> None:
    assert sorted(bit.value for bit in bits) == [1, 2, 4, 8]


def test_i2c_commands_match_the_fpga_pin_levels() -> None:
    """Every value: what the lines of table 6.4 do at these levels, EDGE low."""
    for byte in range(256):
        bits = CommandBits(byte & 0xF)
        levels = [
            int(bit in bits)
            for bit in (CommandBits.SHIFT, CommandBits.RNW, CommandBits.SUNEN, CommandBits.NADEN)
        ]
        wanted = actions(levels[0], 0, *levels[1:])
        if levels == [0, 1, 0, 0]:
            wanted = BOTH_READ  # no bus for both, no reason against it
        assert command_of(byte) == wanted, hex(byte)


def test_command_bytes_round_trip() -> None:
    for row in I2C_COMMANDS:
        assert command_of(command_byte(row.actions)) == row.actions
    assert command_byte(STANDBY) == RESET_COMMAND


def test_i2c_commands_exclude_only_edge_rows() -> None:
    left_out = {row.actions for row in COMMANDS} - {row.actions for row in I2C_COMMANDS}
    assert left_out == {row.actions for row in COMMANDS if row.edge}


def test_rejects_invalid_commands() -> None:
    with pytest.raises(ValueError, match="no command for SEND_PICTURE and SEND_PICTURE; the rows"):
        command_byte(Actions(Action.SEND_PICTURE, Action.SEND_PICTURE))


def test_pointer_bytes_encode_pixel_and_direction() -> None:
    assert pointer_bytes(0, 0) == bytes(3)
    assert pointer_bytes(639, 479) == bytes([0x07, 0x7E, 0x7F])
    assert pointer_bytes(639, 479, down=True) == bytes([0x87, 0x7E, 0x7F])
    assert PointerBits.DOWN & 0x07 == 0, "it is no bit of the address"
    with pytest.raises(ValueError, match=r"pixel \(640, 0\) is not inside"):
        pointer_bytes(FULL_SIZE.columns, 0)
