"""Linux's I2C device files (/dev/i2c-N): constants, and the arguments of their requests.

Numbers and limits are those of Linux's uapi headers linux/i2c.h and linux/i2c-dev.h.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag

MAX_MESSAGES = 42  #: messages per I2C_RDWR
MAX_MESSAGE_BYTES = 8192  #: per message; read and write are truncated, I2C_RDWR rejects more
MAX_BLOCK_BYTES = 32  #: per SMBus block
SMBUS_DATA_BYTES = MAX_BLOCK_BYTES + 2  #: union i2c_smbus_data: a block, its length, a checksum


class Ioctl(IntEnum):
    """Requests of ioctl on a device file."""

    RETRIES = 0x0701
    TIMEOUT = 0x0702
    SLAVE = 0x0703
    TENBIT = 0x0704
    FUNCS = 0x0705
    SLAVE_FORCE = 0x0706
    RDWR = 0x0707
    PEC = 0x0708
    SMBUS = 0x0720


class MessageFlag(IntFlag):
    """Flags of a message of I2C_RDWR."""

    READ = 0x0001
    TEN_BIT = 0x0010
    DMA_SAFE = 0x0200
    RECEIVE_LENGTH = 0x0400


class Function(IntFlag):
    """Capabilities of an adapter, the result of I2C_FUNCS."""

    I2C = 0x0000_0001
    PEC = 0x0000_0008
    BLOCK_PROCESS_CALL = 0x0000_8000
    QUICK = 0x0001_0000
    READ_BYTE = 0x0002_0000
    WRITE_BYTE = 0x0004_0000
    READ_BYTE_DATA = 0x0008_0000
    WRITE_BYTE_DATA = 0x0010_0000
    READ_WORD_DATA = 0x0020_0000
    WRITE_WORD_DATA = 0x0040_0000
    PROCESS_CALL = 0x0080_0000
    READ_BLOCK_DATA = 0x0100_0000
    WRITE_BLOCK_DATA = 0x0200_0000
    READ_I2C_BLOCK = 0x0400_0000
    WRITE_I2C_BLOCK = 0x0800_0000


class SmbusSize(IntEnum):
    """Kinds of SMBus transactions."""

    QUICK = 0
    BYTE = 1
    BYTE_DATA = 2
    WORD_DATA = 3
    PROCESS_CALL = 4
    BLOCK_DATA = 5
    I2C_BLOCK_BROKEN = 6
    BLOCK_PROCESS_CALL = 7
    I2C_BLOCK_DATA = 8


@dataclass(frozen=True)
class RdwrMessage:
    """One message of I2C_RDWR."""

    address: int  #: 7-bit address
    flags: int  #: of MessageFlag
    length: int  #: bytes to write or to read
    #: bytes to write; for a read whose length the device sends, the first byte of its buffer
    data: bytes = b""


@dataclass(frozen=True)
class SmbusCall:
    """The argument of I2C_SMBUS."""

    direction: int  #: 1 to read, 0 to write
    command: int  #: command or register
    size: int  #: of SmbusSize
    data: bytes | None  #: the union i2c_smbus_data, 34 bytes; None for a null pointer


def smbus_data_bytes(size: int) -> int:
    """Largest part, in bytes, of the union i2c_smbus_data that a transaction of ``size`` uses."""
    if size in (SmbusSize.BYTE, SmbusSize.BYTE_DATA):
        return 1
    if size in (SmbusSize.WORD_DATA, SmbusSize.PROCESS_CALL):
        return 2
    return SMBUS_DATA_BYTES
