"""What the protocol suite tries for a telecommand, and where telemetry shows what was set."""

import re
from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.field import Field, InterfaceError, Value
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.devices.device import ConformanceNotes


def read_back(
    interface: Interface, message: Message, notes: ConformanceNotes
) -> dict[str, tuple[Message, Field]]:
    """Where each of a telecommand's fields but keys is shown in telemetry; empty unless all are.

    By name: the field's own, with the telecommand's number or the key behind it, or the
    telecommand's.
    """
    if message.name in notes.not_shown:
        return {}
    keys = keys_of(message, notes)
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
    """Key fields, at the values that are tried."""
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


def values_to_try(message: Message) -> Iterator[dict[str, Value]]:
    """Allowed values of all fields: reset, smallest, largest, in between, single ones."""
    reset = message.reset_values()
    candidates = [reset]
    for share in (0.0, 1.0, 0.5):
        values: dict[str, Value] = {}
        for field in message.fields:
            low, high = limits_of(field)
            value = low + share * (high - low)
            integer = field.type != "f32" and field.scale == 1
            values[field.name] = int(value) if integer else value
        candidates.append(values)
    floats = [field.name for field in message.fields if field.type == "f32"]
    candidates += [reset | {name: 1.0} for name in floats]  # unit vectors among them
    seen = []
    for values in candidates:
        try:
            carried = message.unpack(message.pack(**values))
        except InterfaceError:
            continue
        if not message.violations(carried) and carried not in seen:
            seen.append(carried)
            yield carried


def limits_of(field: Field) -> tuple[float, float]:
    """Smallest and largest allowed value of a field."""
    if field.choices is not None:
        values = [int(choice) for choice in field.choices]
        return min(values), max(values)
    if field.type.startswith("bytes"):
        return 0, 0
    low, high = (0.0, 1.0) if field.type == "f32" else _raw_limits(field)
    return (
        low if field.minimum is None else field.minimum,
        high if field.maximum is None else field.maximum,
    )


def _raw_limits(field: Field) -> tuple[float, float]:
    low, high = field.raw_range
    return low / field.scale, high / field.scale


def violations(message: Message) -> Iterator[tuple[Field, bytes]]:
    """A field and parameters in which it alone is out of range, for each field that can be."""
    reset = message.reset_values()
    for field in message.fields:
        if field.type.startswith("bytes"):
            continue
        tries: list[float] = []
        if field.type == "f32":
            tries.append(float("nan"))
        else:
            tries += _raw_limits(field)
        low, high = limits_of(field)
        tries += [low - 1 / field.scale, high + 1 / field.scale]
        for value in reversed(tries):
            try:
                data = message.pack(**(reset | {field.name: value}))
            except (InterfaceError, ValueError, OverflowError):
                continue
            if field in [wrong for wrong, _ in message.violations(message.unpack(data))]:
                yield field, data
                break
