"""What both FPGAs answer on their bus, byte by byte: written after the registers' declaration."""

from dataclasses import dataclass, field
from enum import Enum

from cubesense_fpga_i2c.register_table import (
    ADDRESSES,
    GROUP_ADDRESS,
    REGISTER_BITS,
    REGISTERS,
    RESET_COMMAND,
    WHO,
    PointerBits,
    Register,
    StatusBits,
    command_of,
)
from cubestack.firmware_model.interface.cubesense.fpga import Action
from cubestack.hdl.contract.bench.geometry import GEOMETRY

BY_NUMBER = {register.address: register for register in REGISTERS}
STORING = (Action.STORE, Action.STORE_OTHER)


class Phase(Enum):
    """What the next byte is."""

    DEAF = "nothing"
    NUMBER = "a register's number"
    WRITE = "for a register"
    READ = "to be sent"


@dataclass
class FpgaModel:
    """One FPGA's registers; ``memory`` is the one of its SRAM's model."""

    side: str
    memory: bytearray
    number: int = 0
    command: int = int(RESET_COMMAND)
    pointer: int = 0
    down: bool = False
    sun: int | None = None  # row : column; None before the first Sun picture
    ack: int = 0
    phase: Phase = Phase.DEAF
    group: bool = False
    commands: list[int] = field(default_factory=list)

    @property
    def action(self) -> Action:
        return getattr(command_of(self.command), self.side)

    def stop(self) -> None:
        self.phase = Phase.DEAF

    def start(self, byte: int) -> bool:
        """The byte after a START; whether it is acknowledged."""
        address, read = byte >> 1, byte & 1
        self.phase = Phase.DEAF
        if address == ADDRESSES[self.side]:
            self.phase, self.group = (Phase.READ if read else Phase.NUMBER), False
        elif address == GROUP_ADDRESS and not read:
            self.phase, self.group = Phase.NUMBER, True
        return self.phase is not Phase.DEAF

    def write(self, byte: int) -> bool:
        """A further byte from the microcontroller; whether it is acknowledged."""
        if self.phase is Phase.NUMBER:
            self.number = byte % (1 << REGISTER_BITS)
            self.phase = Phase.WRITE
            return True
        if self.phase is not Phase.WRITE:
            return False
        register = BY_NUMBER.get(self.number)
        if (
            register is None
            or not register.writable
            or (self.number == Register.COMMAND and not self.group)
        ):
            self.phase = Phase.DEAF
            return False
        if self.number == Register.COMMAND:
            self.command = byte & 0xF
        else:
            low = 8 * (Register.POINTER_LOW - self.number)
            self.pointer &= ~(0xFF << low)
            self.pointer |= byte << low
            self.pointer %= GEOMETRY.bank_size
            if self.number == Register.POINTER_HIGH:
                self.down = bool(byte & PointerBits.DOWN)
        self._go_on()
        return True

    def read(self, more: bool = True) -> int:
        """The next byte that is sent; 0xFF from an FPGA that is not asked."""
        if self.phase is not Phase.READ:
            return 0xFF
        value = self.value()
        if self.number == Register.DATA:
            self.pointer = self._next()
        self._go_on()
        if not more:
            self.phase = Phase.DEAF
        return value

    def value(self) -> int:
        action = self.action
        sun = 0 if action in STORING else self.sun
        pointer = self.pointer
        match self.number:
            case Register.WHO_AM_I:
                return WHO[self.side]
            case Register.STATUS:
                bits = StatusBits.STORING * (action in STORING)
                bits |= StatusBits.SENDING * (action is Action.SEND_PICTURE)
                return bits | StatusBits.READING * (action is Action.READ) | self.ack
            case Register.COMMAND:
                return self.command
            case Register.SUN_HIGH | Register.SUN_MID | Register.SUN_LOW:
                assert sun is not None, "the Sun's place is read before a Sun picture was stored"
                return sun >> 8 * (Register.SUN_LOW - self.number) & 0xFF
            case Register.POINTER_HIGH:
                return pointer >> 16 | PointerBits.DOWN * self.down
            case Register.POINTER_MID:
                return pointer >> 8 & 0xFF
            case Register.POINTER_LOW:
                return pointer & 0xFF
            case Register.DATA:
                return self.memory[self.pointer] if action is Action.READ else 0
        return 0

    def _go_on(self) -> None:
        self.number = min(self.number + 1, (1 << REGISTER_BITS) - 1)

    def _next(self) -> int:
        y, x = divmod(self.pointer, GEOMETRY.address(0, 1))
        if self.down:
            return GEOMETRY.address(x, (y + 1) % GEOMETRY.rows)
        pixel = (y * GEOMETRY.columns + x + 1) % GEOMETRY.pixels
        return GEOMETRY.address(pixel % GEOMETRY.columns, pixel // GEOMETRY.columns)
