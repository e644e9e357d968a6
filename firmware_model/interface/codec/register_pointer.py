"""Registers behind a register pointer on I2C, and on a UART, as data.

A host writes the address of a register, then one data byte in the same transfer; or it reads the
value after a repeated start or in another transfer (CubeSense thesis, section 6.4.3). Values of two
bytes are signed. Assumed, because the text leaves it open:

- The most significant byte comes first.
- Writing the address latches the value, so that both bytes belong together; the pointer stays, and
  a read continues where the previous one stopped, because bus drivers limit the length of one read.
  Writing the address again starts again.
- A read beyond the end of a value, or of an address without a register, returns ``FILL`` bytes.
- A slave cannot reject data: a write to an address without a register, to a read-only register, or
  of a value that is not allowed, is ignored.

On a UART a message is the I2C address with the direction in its lowest bit, the register's address
and, to write, one data byte; the answer to a read is the value.
"""

from collections.abc import Iterator
from dataclasses import InitVar, dataclass

from cubestack.firmware_model.interface.cameras.registers import RegisterAccess
from cubestack.firmware_model.interface.codec.field import Field, InterfaceError, Value, suggestion

#: Byte read where there is no value.
FILL = 0xFF


@dataclass(frozen=True)
class PointerRegister:
    """One register."""

    address: int  #: the pointer's value
    access: RegisterAccess  #: accesses that the host may make
    #: name, type, meaning, unit, scale and limits; whole bytes. A ``bytesN`` is a stream, anything
    #: else a number.
    field: Field

    def __post_init__(self) -> None:
        if not 0 <= self.address <= 255:
            raise InterfaceError(f"register {self.name}: address {self.address} is not a byte")
        if self.field.bits % 8:
            raise InterfaceError(f"register {self.name}: must be whole bytes")
        if self.writable and self.length != 1:
            raise InterfaceError(f"register {self.name}: a host writes one byte, not {self.length}")

    @property
    def name(self) -> str:
        return self.field.name

    @property
    def length(self) -> int:
        return self.field.bits // 8

    @property
    def writable(self) -> bool:
        return self.access is not RegisterAccess.READ_ONLY

    @property
    def readable(self) -> bool:
        return self.access is not RegisterAccess.WRITE_ONLY

    @property
    def streams(self) -> bool:
        """Whether it is a stream of bytes, not a number."""
        return self.field.type.startswith("bytes")

    def allows(self, value: Value) -> bool:
        """Whether a host may write the decoded ``value``."""
        return self.writable and self.field.allows(value, {})

    def encode(self, value: object, *, saturate: bool = True) -> bytes:
        """Bytes of a number, most significant first; raises InterfaceError as ``Field.encode``."""
        if self.streams:
            raise InterfaceError(f"register {self.name} is a stream and carries no number")
        return self.field.encode(value, saturate=saturate).to_bytes(self.length, "big")

    def decode(self, data: bytes) -> Value:
        """The number, or stream, in ``data``; raises InterfaceError for another length."""
        if len(data) != self.length:
            raise InterfaceError(f"register {self.name} has {self.length} bytes, not {len(data)}")
        return data if self.streams else self.field.decode(int.from_bytes(data, "big"))


@dataclass(eq=False)
class PointerMap:
    """All registers behind one I2C address."""

    i2c_address: int
    registers: InitVar[tuple[PointerRegister, ...]]
    note: str = ""  #: describes the map as a whole
    baud: int | None = None  #: rate of a UART with the same protocol, None if there is none

    def __post_init__(self, registers: tuple[PointerRegister, ...]) -> None:
        """Raise InterfaceError if registers share a name or an address."""
        self._by_address: dict[int, PointerRegister] = {}
        self._by_name: dict[str, PointerRegister] = {}
        for register in sorted(registers, key=lambda r: r.address):
            if register.address in self._by_address:
                other = self._by_address[register.address].name
                raise InterfaceError(
                    f"registers {other} and {register.name} both have address "
                    f"{register.address:#04x}"
                )
            if register.name.lower() in self._by_name:
                raise InterfaceError(f"two registers are called {register.name}")
            self._by_address[register.address] = register
            self._by_name[register.name.lower()] = register

    def at(self, address: int) -> PointerRegister | None:
        return self._by_address.get(address)

    def __getitem__(self, name: str) -> PointerRegister:
        """The register ``name``, in any case; raises InterfaceError if there is none."""
        if name.lower() not in self._by_name:
            hint = suggestion(name, [register.name for register in self])
            raise InterfaceError(f"no register {name!r}; {hint}")
        return self._by_name[name.lower()]

    def __iter__(self) -> Iterator[PointerRegister]:
        return iter(self._by_address.values())
