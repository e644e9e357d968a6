"""CubeSense's FPGAs behind an I2C bus of their own: addresses, registers, commands.

CubeSense thesis, section 9.2.1: two wires in place of the microcontroller's control and data pins.
It names no registers; all are assumed. A transfer is as usual: the write address, a register
number, then bytes to that register and those after it; or a read address, and bytes from where
the transfer before stopped. After DATA comes DATA again, else the next number; numbers have four
bits, the upper four are ignored.

- An FPGA acknowledges its own address, and GROUP_ADDRESS for writing; every register number; and
  each byte to a register that can be written. After a byte that it refuses it is deaf until the
  next START.
- COMMAND is taken through GROUP_ADDRESS only, by both FPGAs with the same clock edge, so neither
  ever drives the link while the other one does.
- A number without a register is refused in a write and reads 0.
"""

from enum import IntEnum, IntFlag

from cubestack.firmware_model.interface.cameras.registers import RegisterAccess
from cubestack.firmware_model.interface.codec.field import u8
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.firmware_model.interface.cubesense.fpga import (
    COMMANDS,
    FULL_SIZE,
    Action,
    Actions,
    FpgaCommand,
    ReadOut,
    address_bytes,
)

#: 7-bit addresses on the bus between microcontroller and FPGAs; both FPGAs take the group's.
ADDRESSES = {"sun": 0x31, "nadir": 0x32}
GROUP_ADDRESS = 0x30

#: What WHO_AM_I reads.
WHO = {"sun": ord("S"), "nadir": ord("N")}


class Register(IntEnum):
    """Register numbers."""

    WHO_AM_I = 0x0
    STATUS = 0x1
    COMMAND = 0x2
    SUN_HIGH = 0x4
    SUN_MID = 0x5
    SUN_LOW = 0x6
    POINTER_HIGH = 0xC
    POINTER_MID = 0xD
    POINTER_LOW = 0xE
    DATA = 0xF


#: Bits of a register number.
REGISTER_BITS = 4


class StatusBits(IntFlag):
    """Bits of STATUS; the upper four read 0."""

    ACK = 1  # a whole picture is stored; two SCL periods old
    STORING = 2
    SENDING = 4
    READING = 8


class CommandBits(IntFlag):
    """Bits of COMMAND: the control lines of table 6.3, enables low active; the upper four read 0.

    EDGE has no bit: the pointer takes the place of the scan and window machines.
    """

    NADEN = 1
    SUNEN = 2
    RNW = 4
    SHIFT = 8


class PointerBits(IntFlag):
    """Bits of POINTER_HIGH besides the address."""

    DOWN = 0x80  # the pointer steps down its column, not along its row


#: Standby.
RESET_COMMAND = CommandBits.NADEN | CommandBits.SUNEN

_RO, _RW = RegisterAccess.READ_ONLY, RegisterAccess.READ_WRITE


def _register(
    register: Register, access: RegisterAccess, meaning: str, reset: int = 0
) -> PointerRegister:
    return PointerRegister(register, access, u8(register.name, meaning, reset=reset))


#: All registers, by number. What WHO_AM_I resets to is the side's own.
REGISTERS = tuple(
    _register(*row)
    for row in (
        (Register.WHO_AM_I, _RO, "0x53 the sun's FPGA, 0x4E the nadir's"),
        (
            Register.STATUS,
            _RO,
            "bit 0 ACK, a whole picture is stored; 1 storing; 2 sending to the link; "
            "3 the memory can be read",
        ),
        (
            Register.COMMAND,
            _RW,
            "bit 3 SHIFT, 2 RNW, 1 SUNEN, 0 NADEN, as the lines of table 6.4; "
            "written through the group address only",
            int(RESET_COMMAND),
        ),
        (Register.SUN_HIGH, _RO, "first Sun pixel, row : column, bits 18..16; 0 while storing"),
        (Register.SUN_MID, _RO, "the same, bits 15..8"),
        (Register.SUN_LOW, _RO, "the same, bits 7..0"),
        (
            Register.POINTER_HIGH,
            _RW,
            "address in the memory, row : column, bits 18..16; bit 7 DOWN, steps down its column",
        ),
        (Register.POINTER_MID, _RW, "the same, bits 15..8"),
        (Register.POINTER_LOW, _RW, "the same, bits 7..0"),
        (
            Register.DATA,
            _RO,
            "the byte at the pointer, which then steps; 0 when the memory can not be read",
        ),
    )
)

#: Table 6.4 without its edge rows. Each memory is read over its own FPGA's address, so both may be
#: in turn; that row is assumed, as are the addresses.
I2C_COMMANDS = (
    *(command for command in COMMANDS if not command.edge),
    FpgaCommand(0, 0, 1, 0, 0, Actions(Action.READ, Action.READ)),
)


def command_byte(actions: Actions) -> int:
    """COMMAND's value for what both FPGAs are to do; ValueError when no row has it."""
    for row in I2C_COMMANDS:
        if row.actions == actions:
            levels = (row.naden, row.sunen, row.rnw or 0, row.shift or 0)
            return sum(level << bit for bit, level in enumerate(levels))
    names = " and ".join(action.name for action in actions)
    raise ValueError(f"no command for {names}; the rows are in I2C_COMMANDS")


def command_of(byte: int) -> Actions:
    """What both FPGAs do at a value of COMMAND; an unlisted row is standby for both."""
    bits = CommandBits(byte & 0xF)
    levels = (
        int(CommandBits.SHIFT in bits),
        0,
        int(CommandBits.RNW in bits),
        int(CommandBits.SUNEN in bits),
        int(CommandBits.NADEN in bits),
    )
    for row in I2C_COMMANDS:
        if row.fits(*levels):
            return row.actions
    return Actions(Action.STANDBY, Action.STANDBY)


def pointer_bytes(x: int, y: int, *, down: bool = False, size: ReadOut = FULL_SIZE) -> bytes:
    """What POINTER_HIGH to POINTER_LOW take for pixel (x, y).

    ValueError when the pixel is not inside of the picture.
    """
    high, middle, low = address_bytes(x, y, size)
    return bytes([high | PointerBits.DOWN * down, middle, low])
