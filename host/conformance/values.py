"""Parameter values that the protocol suite tries for a telecommand."""

from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.field import Field, InterfaceError, Value
from cubestack.firmware_model.interface.codec.message import Message


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
    if field.choices is not None:
        values = [int(choice) for choice in field.choices]
        return min(values), max(values)
    if field.type.startswith("bytes"):
        return 0, 0
    low, high = (0.0, 1.0) if field.type == "f32" else _raw_limits(field)
    least, most = field.ends
    return (low if least is None else least, high if most is None else most)


def _raw_limits(field: Field) -> tuple[float, float]:
    low, high = field.raw_range
    return low / field.scale, high / field.scale


def violations(message: Message) -> Iterator[tuple[Field, bytes]]:
    """For each field with limits: the field, and parameters with only this field out of range."""
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
