"""A camera's registers: address pointer, values, and synchronised activation.

An address holds a byte, or a wider word if the camera's table declares it. Accesses to registers
and fields that are declared as not modelled, or not declared, are logged.
"""

import logging
from logging import INFO, WARNING

from cubestack.firmware_model.interface.cameras import registers

logger = logging.getLogger(__name__)


class RegisterFile:
    """The registers of one camera.

    Reading returns the written value. The *active* value is the same for registers that act at
    once, and the value at the last sync for the others.
    """

    def __init__(self, table: registers.CameraRegisterMap) -> None:
        self._table = table
        self._written: dict[int, int] = {}
        self._active: dict[int, int] = {}
        self.reset()

    def reset(self) -> None:
        self._pointer = 0
        for register in self._table:
            self.store(register.name, register.reset)

    def select(self, address: int) -> None:
        """Set the address of the next byte to read or write."""
        self._pointer = address

    def write(self, byte: int) -> registers.CameraRegister | None:
        """Write the next byte; returns its register, or None if there is none."""
        address, register = self._step()
        if register is None:
            self._log(WARNING, "wrote %#04x to %#06x, where no register is known", byte, address)
        elif register.access is registers.RegisterAccess.READ_ONLY:
            self._log(WARNING, "wrote to %s, which is read-only", register.name)
        else:
            self._log_unmodelled(register, address, byte)
            self._written[address] = byte
            if not register.needs_sync:
                self._active[address] = byte
        return register

    def read(self) -> int:
        """Read the next byte; 0 where no register is declared."""
        address, register = self._step()
        if register is None:
            self._log(WARNING, "read %#06x, where no register is known", address)
            return 0
        if not register.modelled:
            self._log(INFO, "read %s, which is not modelled", register.name)
        return self._written[address]

    def peek(self, address: int) -> int:
        """The value at an address, without side effects; 0 where no register is declared."""
        return self._written.get(address, 0)

    def written(self) -> dict[str, int]:
        """The values written last, by the registers' names."""
        return {register.name: self._value(register, self._written) for register in self._table}

    def sync(self) -> None:
        self._active = dict(self._written)

    def active(self, name: str) -> int:
        """The active value of register ``name``."""
        return self._value(self._table[name], self._active)

    def store(self, name: str, value: int) -> None:
        """Set a register from the camera's side, active at once."""
        register = self._table[name]
        for address, byte in zip(register.addresses, register.units(value), strict=True):
            self._written[address] = self._active[address] = byte

    def _value(self, register: registers.CameraRegister, values: dict[int, int]) -> int:
        value = 0
        for address in register.addresses:
            value = value << register.unit_bits | values[address]
        return value

    def _step(self) -> tuple[int, registers.CameraRegister | None]:
        address = self._pointer
        self._pointer = (address + 1) % (1 << (8 * self._table.address_bytes))
        return address, self._table.at(address)

    def _log_unmodelled(self, register: registers.CameraRegister, address: int, byte: int) -> None:
        if not register.modelled:
            self._log(INFO, "wrote %s, which is not modelled", register.name)
            return
        value = byte << (register.unit_bits * (register.addresses[-1] - address))
        for field in register.fields:
            if value & field.mask and not field.modelled:
                self._log(INFO, "set %s of %s, which is not modelled", field.name, register.name)
        if other := value & ~register.bits:
            self._log(WARNING, "set bits %#04x of %s, which are not known", other, register.name)

    def _log(self, level: int, text: str, *values: object) -> None:
        logger.log(level, f"%s: {text}", self._table.camera, *values)
