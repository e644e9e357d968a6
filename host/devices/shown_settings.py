"""Settings that telemetry shows: where, and their values after power-up."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cubestack.firmware_model.interface.codec.field import Field, Value
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.devices.device import ConformanceNotes


@dataclass(frozen=True)
class Setting:
    """A setting that telemetry shows."""

    telecommand: Message  #: that sets it
    parameter: Field  #: its field there, with the default as reset value
    frame: Message  #: telemetry that shows it
    shown: Field  #: its field there


def settings(interface: Interface, notes: ConformanceNotes) -> Iterator[Setting]:
    """All settings that an interface shows, for each value of the key fields."""
    for message in interface.telecommands:
        if not message.supported:
            continue
        for keys in _all_keys(message, notes):
            for name, (frame, shown) in read_back(interface, message, notes, keys).items():
                if not frame.has_side_effect:
                    yield Setting(message, message.field(name), frame, shown)


def _all_keys(message: Message, notes: ConformanceNotes) -> Iterator[dict[str, Value]]:
    first = keys_of(message, notes)
    if not first:
        yield first
    for name in first:
        field = message.field(name)
        low, high = (int(end or 0) for end in field.ends)
        for value in range(low, high + 1):
            yield {name: value}


def read_back(
    interface: Interface,
    message: Message,
    notes: ConformanceNotes,
    keys: Mapping[str, Value] | None = None,
) -> dict[str, tuple[Message, Field]]:
    """Where each of a telecommand's fields but keys is shown in telemetry; empty unless all are.

    By name: the field's own, with the telecommand's number or the key behind it, or the
    telecommand's. ``keys`` are values of the key fields; None for those of ``keys_of``.
    """
    if message.name in notes.not_shown:
        return {}
    keys = keys_of(message, notes) if keys is None else keys
    number = re.sub(r".*?(\d*)$", r"\1", message.name)
    found = {}
    for field in message.fields:
        if field.name in keys:
            continue
        behind = "".join(str(key) for key in keys.values()) or number
        names = [field.name + behind]
        if len(message.fields) == 1:
            names.append(message.name)
        ending = number if keys else ""
        place = _place(interface, field, [name.lower() for name in names], ending)
        if place is None:
            return {}
        found[field.name] = place
    return found


def keys_of(message: Message, notes: ConformanceNotes) -> dict[str, Value]:
    reset = message.reset_values()
    return {name: value for name, value in reset.items() if name in notes.keys}


def _place(
    interface: Interface, field: Field, names: list[str], ending: str
) -> tuple[Message, Field] | None:
    for telemetry in interface.telemetries:
        if telemetry.supported and not telemetry.steps and telemetry.name.endswith(ending):
            for shown in telemetry.fields:
                as_set = (shown.type, shown.scale, shown.unit)
                if shown.name.lower() in names and as_set == (field.type, field.scale, field.unit):
                    return telemetry, shown
    return None
