"""One field of a telecommand or telemetry frame: its bits, scale, limits and meaning.

Byte order, rounding and saturation are part of the declaration (CubeSpace family of nodes,
interface version 3; the order is published, rounding and saturation are assumed):

- Fields are little-endian: bit 0 of a message is the lowest bit of its first byte.
- ``scale`` is what the printed tables divide by: value = raw / scale.
- Rounding is to the nearest count, half away from zero.
- Telemetry saturates at the ends of its type, and not-a-number becomes 0 in an integer: what the
  conversion routines of a Cortex-M3 do. A telecommand parameter that its type cannot carry is an
  error of the sender instead.
"""

import math
import re
import struct
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import KW_ONLY, dataclass, field, replace
from difflib import get_close_matches
from enum import Enum, IntEnum
from functools import cached_property, partial
from typing import Self

from cubestack.firmware_model.values import FLAG, NUMBER, WHOLE, Declaration

#: A field's value: bool for bool1, bytes for bytesN, a number for all others.
Value = int | float | bool | bytes

#: Format of each type in module struct.
_ITEMS = {"bool1": "?", "u8": "B", "enum8": "B", "u16": "H", "i16": "h", "u32": "I", "f32": "f"}
_BYTES = re.compile(r"bytes([1-9][0-9]*)")

#: The allowed values of a field, with their names.
Choices = type[IntEnum]


class InterfaceError(ValueError):
    """A message, field or value that the interface does not have; the text is one line."""


def suggestion(word: str, known: list[str]) -> str:
    """One phrase that names the nearest of ``known``, or all of them when none is near."""
    lower = {name.lower(): name for name in known}
    near = get_close_matches(word.lower(), lower, n=1)
    return f"did you mean {lower[near[0]]}?" if near else "known: " + ", ".join(known)


def _nearest_f32(value: float) -> float:
    """``value`` as float32 carries it; beyond its range, infinity."""
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def _round_half_away(value: float) -> int:
    whole = int(value)
    rest = value - whole
    return whole + (rest >= 0.5) - (rest <= -0.5)


class Severity(Enum):
    """How an operator rates a flag that is set."""

    STATE = "a state, no problem"
    NOTICE = "something was refused, lost or cut short; the node works on"
    FAULT = "a part failed, or does not do what it should"


@dataclass(frozen=True)
class Flag:
    """An error flag in a block of flags.

    Attributes:
        bit: in the block.
        name: in this frame.
        meaning: its cause.
        group: what it is about, a word or two.
        severity: how an operator rates it.
        shows: the flag's own name, if this frame prints another one.
    """

    bit: int
    name: str
    meaning: str
    group: str
    severity: Severity = Severity.NOTICE
    shows: str = ""


@dataclass(frozen=True)
class Field(Declaration):
    """A field of a message; u8, u16, ... below make one of their type.

    ``low`` and ``high`` are in ``unit``; numbers without a limit of their own have their type's.

    Attributes:
        scale: raw counts for one unit.
        type: bool1, u8, u16, u32, i16, f32, enum8, or bytesN (N bytes).
        also: a value that is allowed beyond the limits, or None.
        high_by: (other field, {its value: largest allowed value here}), or None.
        choices_by: (other field, {its value: the choices that go with it}), or None.
        range_flag: error flag that a value outside these limits raises, or empty.
        flag: for a bool1 that shows an error flag: that flag's name.
        group: what that flag is about, a word or two.
        severity: how an operator rates a bool1 that is set.
        counter: whether it counts events, so that two equal devices may show other values.
        reset: value after power-up; None takes zero.
        gap: unused bits between the field before and this one.
        bit_offset: first bit in its message, which places it; 0 outside of one.
    """

    name: str
    meaning: str = ""
    unit: str = ""
    scale: float = 1.0
    _: KW_ONLY
    type: str
    choices: Choices | None = None
    also: float | None = None
    high_by: tuple[str, Mapping[int, float]] | None = None
    choices_by: tuple[str, Mapping[int, Choices]] | None = None
    range_flag: str = ""
    flag: str = ""
    group: str = ""
    severity: Severity = Severity.STATE
    counter: bool = False
    reset: Value | None = None
    gap: int = 0
    bit_offset: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Check the declaration; raises InterfaceError."""
        if self.type not in _ITEMS and not _BYTES.fullmatch(self.type):
            known = ", ".join((*_ITEMS, "bytesN"))
            raise InterfaceError(f"field {self.name}: no type {self.type!r}; known: {known}")
        if self.gap < 0:
            raise InterfaceError(f"field {self.name}: a gap has no {self.gap} bits")
        if not self.scale > 0:
            raise InterfaceError(f"field {self.name}: scale must be positive, not {self.scale}")
        if self.reset is None:
            object.__setattr__(self, "reset", self.decode(0))
        number = NUMBER if self.type == "f32" or self.scale != 1 else WHOLE
        object.__setattr__(self, "kind", FLAG if self.type == "bool1" else number)
        object.__setattr__(self, "default", self.reset)

    @property
    def byte_offset(self) -> int:
        """The byte of its message in which it begins."""
        return self.bit_offset // 8

    @property
    def place(self) -> str:
        """Its byte, with the bit within if it is a part of one: "4", "2.3"."""
        bit = self.bit_offset % 8
        return f"{self.byte_offset}.{bit}" if bit or self.bits % 8 else f"{self.byte_offset}"

    @cached_property
    def item(self) -> str:
        """Format of its counts in module struct; a bool1 in a message is a bit of it."""
        match = _BYTES.fullmatch(self.type)
        return f"{match[1]}s" if match else _ITEMS[self.type]

    @cached_property
    def scaled(self) -> bool:
        """Whether its values are counts divided by ``scale``; other types ignore a scale."""
        return self.scale != 1.0 and self.item in "BHhI"

    @cached_property
    def bits(self) -> int:
        """Width in bits."""
        return 1 if self.type == "bool1" else 8 * struct.calcsize(f"<{self.item}")

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """``low`` and ``high``; None for no limit."""
        low, high = (one if math.isfinite(one) else None for one in (self.low, self.high))
        return low, high

    def within(self, low: float | None, high: float | None, flag: str = "") -> Self:
        """This field with its limits, in ``unit``, and the error flag that others raise."""
        ends = -math.inf if low is None else low, math.inf if high is None else high
        return replace(self, low=ends[0], high=ends[1], range_flag=flag)

    def behind(self, end: int) -> Self:
        """This field, placed after a field that ends before bit ``end``, and after its own gap.

        A bool1 takes the next bit, all other types begin with the next byte.
        """
        placed, start = copy(self), end + self.gap
        if self.type != "bool1":
            start = -(-start // 8) * 8
        object.__setattr__(placed, "bit_offset", start)
        return placed

    @cached_property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest raw count of an integer type."""
        if self.type == "i16":
            return -(1 << 15), (1 << 15) - 1
        return 0, (1 << self.bits) - 1

    def count(self, value: object, *, saturate: bool) -> Value:
        """What ``item`` carries for ``value``: a number, a bool, bytes, or the name of a choice.

        With ``saturate``, numbers beyond the type become its ends and not-a-number becomes 0 in
        an integer; without, they raise InterfaceError. A value of a wrong kind always does.
        """
        kind = self.type
        if kind.startswith("bytes"):
            return self._checked_bytes(value)
        number = float(value) if isinstance(value, (int, float)) else self._number(value)
        if kind == "f32":
            nearest = _nearest_f32(number)
            if math.isinf(nearest) and not math.isinf(number) and not saturate:
                raise InterfaceError(f"field {self.name}: {value!r} is too large for a float32")
            return nearest
        counts = number * self.scale
        low, high = self.raw_range
        if not (saturate or low - 0.5 < counts < high + 0.5):
            raise InterfaceError(
                f"field {self.name}: {value!r} does not fit; {self.type} carries "
                f"{low / self.scale:g} to {high / self.scale:g} {self.unit}".rstrip()
            )
        if not low <= counts <= high:
            counts = 0 if math.isnan(counts) else low if counts < low else high
        whole = _round_half_away(counts)
        return bool(whole) if kind == "bool1" else whole

    def encode(self, value: object, *, saturate: bool) -> int:
        """Bits of ``value``; it converts, saturates and raises as ``count`` does."""
        data = struct.pack(f"<{self.item}", self.count(value, saturate=saturate))
        return int.from_bytes(data, "little")

    def decode(self, raw: int) -> Value:
        """Value of the field's bits ``raw``."""
        (count,) = struct.unpack(f"<{self.item}", raw.to_bytes((self.bits + 7) // 8, "little"))
        return count / self.scale if self.scaled else count  # type: ignore[no-any-return]

    def allows(self, value: Value, others: Mapping[str, Value]) -> bool:
        """Whether a decoded ``value`` is within the limits; ``others`` are its message's values."""
        if isinstance(value, bytes) or value == self.also:
            return True
        if self.choices is not None and value not in {int(choice) for choice in self.choices}:
            return False
        if self.choices_by is not None:
            other, choices = self.choices_by
            if value not in {int(choice) for choice in choices.get(int(others[other]), ())}:
                return False
        low, high = self.low, self.high
        if self.high_by is not None:
            other, limits = self.high_by
            high = limits.get(int(others[other]), high)  # an unlisted one is that field's
        if self.type == "f32":  # the limits as the wire carries them: pi / 2 is allowed
            low, high = _nearest_f32(low), _nearest_f32(high)
        return math.isfinite(value) and low <= value <= high

    def label(self, value: Value) -> str:
        """``value`` for a reader: the choice's name, hexadecimal bytes, or number and unit."""
        if isinstance(value, bytes):
            return value.hex()
        if self.choices is not None and value in {int(choice) for choice in self.choices}:
            return self.choices(int(value)).name
        text = f"{value:.7g}" if isinstance(value, float) else str(value)
        return f"{text} {self.unit}".rstrip()

    def _number(self, value: object) -> float:
        if isinstance(value, str) and self.choices is not None:
            names = {choice.name.lower(): choice for choice in self.choices}
            if value.lower() in names:
                return float(names[value.lower()])
            hint = suggestion(value, [choice.name for choice in self.choices])
            raise InterfaceError(f"field {self.name}: no choice {value!r}; {hint}")
        if hasattr(value, "__float__"):  # SupportsFloat, but the protocol's look takes longer
            return float(value)
        raise InterfaceError(f"field {self.name}: {value!r} is not a number ({self.type})")

    def _checked_bytes(self, value: object) -> bytes:
        if not isinstance(value, bytes | bytearray | memoryview):
            raise InterfaceError(f"field {self.name}: {value!r} is not bytes")
        if len(value) != self.bits // 8:
            raise InterfaceError(
                f"field {self.name}: has {len(value)} bytes, must have {self.bits // 8}"
            )
        return bytes(value)


u8, u16, u32 = partial(Field, type="u8"), partial(Field, type="u16"), partial(Field, type="u32")
i16, f32 = partial(Field, type="i16"), partial(Field, type="f32")
bool1, enum8 = partial(Field, type="bool1"), partial(Field, type="enum8")


def byte_array(count: int, name: str, meaning: str) -> Field:
    """A field of ``count`` bytes."""
    return Field(name, meaning, type=f"bytes{count}")


def flags_at(flags: Iterable[Flag]) -> tuple[Field, ...]:
    """A block of bool1 that show error flags, by ascending bits; those between are unused."""
    fields, end = [], 0
    for one in flags:
        field = bool1(one.name, one.meaning, flag=one.shows or one.name, gap=one.bit - end)
        fields.append(replace(field, group=one.group, severity=one.severity))
        end = one.bit + 1
    return tuple(fields)
