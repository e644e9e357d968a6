"""Messages and interfaces as data: telecommands and telemetry frames with their fields.

Frame layouts of the CubeSpace family of nodes: IDs below 128 are telecommands, others telemetry
frames; both have a fixed length. Firmware decodes with these declarations, hosts encode with them,
and documentation is generated from them.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from functools import cached_property
from itertools import pairwise

from cubestack.firmware_model.interface.codec.field import (
    Choices,
    Field,
    InterfaceError,
    Value,
    suggestion,
)
from cubestack.firmware_model.interface.codec.layout import Layout
from cubestack.firmware_model.interface.codec.letters import LetterProtocol
from cubestack.firmware_model.interface.codec.register_pointer import PointerMap
from cubestack.firmware_model.interface.codec.switches import Switches

#: Set in the IDs of telemetry, clear in those of telecommands.
TELEMETRY_BIT = 0x80


class MessageKind(Enum):
    """Direction of a message."""

    TELECOMMAND = "telecommand"
    TELEMETRY = "telemetry"


class Confidence(Enum):
    """How well the layout of a message is known."""

    HIGH = "layout seen working with a real host"
    MEDIUM = "layout read in a real host"
    LOW = "layout only declared somewhere"


@dataclass(frozen=True)
class Message:
    """A telecommand or telemetry frame.

    Attributes:
        id: ID byte on the wire; its bit 7 determines the kind.
        name: printed name.
        meaning: one phrase for a reader.
        fields: in order of their offsets, without gaps.
        ordered: pairs of field names; the first value must not exceed the second.
        extension: added by this project to the published interface.
        risk: what a telecommand interrupts or erases; hosts ask before they send it.
        steps: each read returns the next of several records, and wraps.
        starts_measurement: a read makes the node measure again.
        supported: False if the node rejects the ID as unknown.
        confidence: how well the layout is known; None if it is printed, or an extension.
        length: bytes of parameters or data.
    """

    id: int
    name: str
    meaning: str = ""
    fields: tuple[Field, ...] = ()
    ordered: tuple[tuple[str, str], ...] = ()
    extension: bool = False
    risk: str = ""
    steps: bool = False
    starts_measurement: bool = False
    supported: bool = True
    confidence: Confidence | None = None
    length: int = dataclasses.field(default=0, init=False)

    def __post_init__(self) -> None:
        """Place the fields and check the declaration; raises InterfaceError."""
        if not 0 <= self.id <= 255:
            raise InterfaceError(f"message {self.name}: ID {self.id} is not a byte")
        placed: list[Field] = []
        end = 0
        for one in self.fields:
            placed.append(one.behind(end))
            end = placed[-1].bit_offset + one.bits
        object.__setattr__(self, "fields", tuple(placed))
        object.__setattr__(self, "length", (end + 7) // 8)
        names = [field.name for field in self.fields]
        if len(set(names)) != len(names):
            raise InterfaceError(f"message {self.name}: two fields of one name")
        related = [name for pair in self.ordered for name in pair]
        dependent = [by for f in self.fields for by in (f.high_by, f.choices_by) if by]
        related += [other for other, _ in dependent]
        for name in related:
            self.field(name)
        if self.kind is MessageKind.TELECOMMAND:
            wrong = self.violations(self.reset_values())
            if wrong:
                raise InterfaceError(
                    f"message {self.name}: the reset value of {wrong[0][0].name} is out of range"
                )

    @cached_property
    def _layout(self) -> Layout:
        return Layout(self.fields, self.length, saturate=self.kind is MessageKind.TELEMETRY)

    def of(self, *fields: Field, ordered: tuple[tuple[str, str], ...] = ()) -> "Message":
        """This message with consecutive ``fields`` and pairs of ``ordered`` field names."""
        return dataclasses.replace(self, fields=fields, ordered=ordered)

    @property
    def kind(self) -> MessageKind:
        return MessageKind.TELEMETRY if self.id & TELEMETRY_BIT else MessageKind.TELECOMMAND

    @property
    def has_side_effect(self) -> bool:
        """Whether a read changes the node's state."""
        return self.steps or self.starts_measurement

    def field(self, name: str) -> Field:
        """The field ``name``, in any case; raises InterfaceError if there is none."""
        for field in self.fields:
            if field.name.lower() == name.lower():
                return field
        raise InterfaceError(f"{self.name} has no field {name!r}; {self._field_hint(name)}")

    def reset_values(self) -> dict[str, Value]:
        return {f.name: f.decode(f.encode(f.reset, saturate=False)) for f in self.fields}

    def pack(self, **values: object) -> bytes:
        """``length`` bytes with ``values``, one for each field.

        Telemetry saturates; a telecommand's value that does not fit its type, and an unknown or
        missing field, raise InterfaceError. The node checks limits (``violations``).
        """
        layout = self._layout
        if values.keys() != layout.names:
            for name in values:
                if name not in layout.names:
                    hint = self._field_hint(name)
                    raise InterfaceError(f"{self.name} has no field {name!r}; {hint}")
            missing = [field.name for field in self.fields if field.name not in values]
            raise InterfaceError(f"{self.name} needs a value for {', '.join(missing)}")
        try:
            return layout.pack(values)
        except InterfaceError as error:
            raise InterfaceError(f"{self.name}: {error}") from None

    def unpack(self, data: bytes) -> dict[str, Value]:
        """Every field's value in ``data``; raises InterfaceError for a wrong length."""
        if len(data) != self.length:
            raise InterfaceError(f"{self.name} has {self.length} bytes, not {len(data)}")
        return self._layout.unpack(data)

    def violations(self, values: Mapping[str, Value]) -> list[tuple[Field, str]]:
        """Fields whose decoded value is not allowed, each with its error flag or ""."""
        wrong = [field for field in self.fields if not field.allows(values[field.name], values)]
        for low, high in self.ordered:
            below, above = values[low], values[high]
            if not isinstance(below, bytes) and not isinstance(above, bytes) and below > above:
                wrong.append(self.field(low))
        return [(field, field.range_flag) for field in wrong]

    def _field_hint(self, name: str) -> str:
        known = [field.name for field in self.fields]
        return suggestion(name, known) if known else "it has no fields"


@dataclass(frozen=True)
class Interface:
    """All messages of a node, and the device's other protocols.

    Attributes:
        version: interface version that the node reports.
        i2c_address: default 7-bit address.
        baud: default baud rate of its serial line.
        telecommands, telemetries: by ascending ID.
        ack_errors: error codes of a telecommand's acknowledge; 0 is no error.
        registers: registers behind another I2C address, or None.
        service_port: one-letter protocol on another serial port, or None.
        switches: choices between published and better algorithms.
        node_type: first byte of its identification; 0: that in the table of the telemetry.
    """

    name: str
    version: int
    i2c_address: int
    baud: int
    telecommands: tuple[Message, ...]
    telemetries: tuple[Message, ...]
    ack_errors: type[IntEnum]
    registers: PointerMap | None = None
    service_port: LetterProtocol | None = None
    switches: type[Switches] = Switches
    node_type: int = 0

    def __post_init__(self) -> None:
        for messages, kind in (
            (self.telecommands, MessageKind.TELECOMMAND),
            (self.telemetries, MessageKind.TELEMETRY),
        ):
            for message in messages:
                if message.kind is not kind:
                    raise InterfaceError(f"{message.name}: ID {message.id} is no {kind.value}'s")
            for one, two in pairwise(messages):
                if one.id == two.id:
                    raise InterfaceError(f"{two.name}: ID {two.id} is taken by {one.name}")
                if one.id > two.id:
                    raise InterfaceError(f"{two.name}: ID {two.id} must be before {one.id}")
            if len({message.name.lower() for message in messages}) != len(messages):
                raise InterfaceError(f"{self.name}: two {kind.value}s of one name")

    @property
    def messages(self) -> tuple[Message, ...]:
        return self.telecommands + self.telemetries

    @property
    def choices(self) -> tuple[Choices, ...]:
        """The sets of named numbers in fields, without ``ack_errors``, by first use."""
        fields = [field for message in self.messages for field in message.fields]
        if self.registers is not None:
            fields += [register.field for register in self.registers]
        used = dict.fromkeys(field.choices for field in fields)
        return tuple(choices for choices in used if choices not in (None, self.ack_errors))

    def telecommand(self, key: str | int) -> Message:
        """The telecommand with this name (in any case) or ID; raises InterfaceError if none."""
        return self._lookup(self._telecommands, "telecommand", key)

    def telemetry(self, key: str | int) -> Message:
        """The telemetry frame with this name (in any case) or ID; raises InterfaceError if none."""
        return self._lookup(self._telemetries, "telemetry frame", key)

    def find(self, identifier: int) -> Message | None:
        """The supported message with this ID byte; None for an invalid ID."""
        return self._supported.get(identifier)

    @cached_property
    def _supported(self) -> dict[int, Message]:
        return {message.id: message for message in self.messages if message.supported}

    @cached_property
    def _telecommands(self) -> dict[str | int, Message]:
        return _by_key(self.telecommands)

    @cached_property
    def _telemetries(self) -> dict[str | int, Message]:
        return _by_key(self.telemetries)

    def _lookup(self, messages: dict[str | int, Message], kind: str, key: str | int) -> Message:
        found = messages.get(key.lower() if isinstance(key, str) else key)
        if found is not None:
            return found
        hint = suggestion(str(key), list(dict.fromkeys(one.name for one in messages.values())))
        raise InterfaceError(f"{self.name} has no {kind} {key!r}; {hint}")


def _by_key(messages: tuple[Message, ...]) -> dict[str | int, Message]:
    """Messages by ID, and by name in lower case."""
    by_key: dict[str | int, Message] = {one.id: one for one in messages}
    return by_key | {one.name.lower(): one for one in messages}
