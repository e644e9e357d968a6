"""Camera control registers: addresses, widths, bit fields, and which of them are modelled.

Pure data: the firmware looks up a register's address and bits by name, the camera model decodes
writes, documents list it. Values of several bytes have the most significant byte at the lowest
address.
"""

from collections.abc import Iterator
from dataclasses import InitVar, dataclass, replace
from enum import Enum


class UnknownRegisterError(ValueError):
    """No register or bit field has the requested name."""


class RegisterAccess(Enum):
    """Accesses that the control bus may make."""

    READ_WRITE = "rw"
    READ_ONLY = "ro"
    WRITE_ONLY = "wo"


@dataclass(frozen=True)
class BitField:
    """Adjacent bits of a register; the camera model ignores them unless ``modelled``."""

    name: str
    lsb: int
    width: int
    meaning: str
    modelled: bool = True

    @property
    def mask(self) -> int:
        return ((1 << self.width) - 1) << self.lsb

    def of(self, register_value: int) -> int:
        """The field's value in the register's value."""
        return (register_value & self.mask) >> self.lsb


@dataclass(frozen=True)
class CameraRegister:
    """One register."""

    address: int  #: of its first, most significant byte
    name: str  #: unique within the map
    reset: int  #: value after power-up and reset, unsigned
    meaning: str  #: effect of the value
    fields: tuple[BitField, ...] = ()  #: declared bits; none if the value is one number
    width: int = 1  #: number of addresses that it occupies
    access: RegisterAccess = RegisterAccess.READ_WRITE  #: accesses that the control bus may make
    needs_sync: bool = False  #: a written value takes effect only with the sync register
    #: False if the camera model stores the value, with all its fields, but ignores it
    modelled: bool = True
    #: parts of this declaration that no document states; empty if all are published
    assumed: str = ""
    unit_bits: int = 8  #: bits per address

    def __post_init__(self) -> None:
        if not self.modelled:
            fields = tuple(replace(field, modelled=False) for field in self.fields)
            object.__setattr__(self, "fields", fields)

    def of(self, *fields: BitField) -> "CameraRegister":
        return replace(self, fields=fields)

    @property
    def addresses(self) -> range:
        return range(self.address, self.address + self.width)

    @property
    def bits(self) -> int:
        """Mask of the declared bits: the whole register if it has no fields."""
        if not self.fields:
            return (1 << (self.unit_bits * self.width)) - 1
        return sum(field.mask for field in self.fields)

    def value(self, **fields: int) -> int:
        """Value with the named bit fields set and all others 0."""
        return sum(value << self.field(name).lsb for name, value in fields.items())

    def units(self, value: int) -> list[int]:
        """``value`` split by addresses, most significant part first."""
        part = (1 << self.unit_bits) - 1
        shifts = reversed(range(self.width))
        return [value >> (self.unit_bits * shift) & part for shift in shifts]

    def field(self, name: str) -> BitField:
        """The bit field ``name``; raises UnknownRegisterError if there is none."""
        for field in self.fields:
            if field.name == name:
                return field
        raise UnknownRegisterError(
            f"register {self.name} has no bit field {name!r}, "
            f"only {', '.join(field.name for field in self.fields) or 'none'}"
        )


@dataclass(eq=False)
class CameraRegisterMap:
    """All registers of a camera; an address has its most significant byte first."""

    camera: str
    i2c_address: int
    address_bytes: int
    registers: InitVar[tuple[CameraRegister, ...]]

    def __post_init__(self, registers: tuple[CameraRegister, ...]) -> None:
        """Raise ValueError if registers share a name or an address."""
        self._by_name: dict[str, CameraRegister] = {}
        self._by_address: dict[int, CameraRegister] = {}
        for register in sorted(registers, key=lambda r: r.address):
            if register.name in self._by_name:
                raise ValueError(f"{self.camera} declares register {register.name} twice")
            self._by_name[register.name] = register
            for address in register.addresses:
                if address in self._by_address:
                    raise ValueError(
                        f"{self.camera} registers {self._by_address[address].name} and "
                        f"{register.name} both have address {address:#06x}"
                    )
                self._by_address[address] = register

    def __getitem__(self, name: str) -> CameraRegister:
        """The register ``name``; raises UnknownRegisterError if there is none."""
        if name not in self._by_name:
            raise UnknownRegisterError(
                f"{self.camera} has no register {name!r}, only {', '.join(self._by_name)}"
            )
        return self._by_name[name]

    def __iter__(self) -> Iterator[CameraRegister]:
        return iter(self._by_name.values())

    def at(self, address: int) -> CameraRegister | None:
        """The register that contains the byte at ``address``, or None."""
        return self._by_address.get(address)
