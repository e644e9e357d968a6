"""Declaration of a pin, for gateware, constraint files, wiring and firmware."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

#: From the FPGA's side; "tristate" is an output that can be switched off.
Direction = Literal["input", "output", "tristate", "inout"]


@dataclass(frozen=True)
class Port:
    """One side of a pin in the gateware, which has no bidirectional lines."""

    name: str  #: of the port
    output: bool  #: whether the gateware drives it
    width: int  #: in bits
    level: int = 0  #: of an undriven input, or of an output in reset


class Pin(str):
    """A pin of an FPGA board, or a bus of them: its name, with attributes."""

    direction: Direction  #: from the FPGA's side
    meaning: str  #: its purpose
    width: int  #: number of pins
    level: int  #: of an undriven input, or in reset of an output that cannot be switched off
    enables: int  #: bits of the output enable: 0 for none, 1 for all pins, or ``width``
    #: level_in, level_out, enable: names of the gateware's ports; None if absent
    level_in: str | None
    level_out: str | None
    enable: str | None

    def __new__(
        cls,
        name: str,
        direction: Direction,
        meaning: str,
        width: int = 1,
        *,
        level: int = 0,
        enables: int = 1,
        bare: bool = False,
    ) -> "Pin":
        """Declare a pin; its ports are NAME, or NAME_I, NAME_O and NAME_OE.

        ``bare``: the driven level has the port NAME, although it can be switched off.
        """
        pin = super().__new__(cls, name)
        pin.direction, pin.meaning, pin.width, pin.level = direction, meaning, width, level
        switched = direction in ("tristate", "inout")
        pin.enables = enables if switched else 0
        pin.enable = f"{name}_OE" if switched else None
        pin.level_out = None if direction == "input" else name
        pin.level_in = name if direction == "input" else None
        if switched:
            pin.level_out = name if bare else f"{name}_O"
            pin.level_in = f"{name}_I" if direction == "inout" else None
        return pin

    def __reduce__(self) -> tuple[type["Pin"], tuple[str, Direction, str], dict[str, object]]:
        """For copies: the smallest declaration, then all attributes."""
        return Pin, (str(self), self.direction, self.meaning), self.__dict__

    def copy(self, name: str = "", *, meaning: str = "", width: int = 0) -> "Pin":
        """A copy with another name, meaning or width."""
        return Pin(
            name or self,
            self.direction,
            meaning or self.meaning,
            width or self.width,
            level=self.level,
            enables=self.enables,
            bare=self.level_out == self,
        )

    @property
    def ports(self) -> tuple[Port, ...]:
        """The gateware's ports, input first."""
        found = []
        if self.level_in:
            found.append(Port(self.level_in, False, self.width, self.level))
        if self.level_out:
            level = 0 if self.enable else self.level
            found.append(Port(self.level_out, True, self.width, level))
        if self.enable:
            found.append(Port(self.enable, True, self.enables))
        return tuple(found)


def resized(pins: Iterable[Pin], **widths: int) -> tuple[Pin, ...]:
    """Copies of the pins, with other ``widths`` of the named ones."""
    return tuple(pin.copy(width=widths.get(pin, pin.width)) for pin in pins)


def sram_pins(address_bits: int, address: str = "SRAM address") -> tuple[Pin, ...]:
    """Pins to an SRAM of bytes; strobes are active low."""
    return (
        Pin("SRAM_A", "output", address, address_bits),
        Pin("SRAM_D", "inout", "SRAM data", 8),
        Pin("SRAM_CE_N", "output", "SRAM chip enable, low active", level=1),
        Pin("SRAM_OE_N", "output", "SRAM output enable, low active", level=1),
        Pin("SRAM_WE_N", "output", "SRAM write enable, low active", level=1),
    )
