"""One field of an interface as text and as data."""

from cubestack.firmware_model.interface.codec.field import Choices, Field


def field_type(field: Field) -> str:
    return field.type if field.scale == 1 else f"{field.type} / {field.scale:g}"


def field_details(field: Field) -> str:
    """Meaning, unit, allowed values, reset value and error flag."""
    low, high = field.ends
    parts = [field.meaning + (f" [{field.unit}]" if field.unit else "")]
    if field.choices is not None:
        parts.append(f"see {field.choices.__name__}")
    if field.choices_by is not None:
        other, sets = field.choices_by
        parts.append(f"by {other}, see {', '.join(choices.__name__ for choices in sets.values())}")
    if field.high_by is not None:
        other, limits = field.high_by
        listed = ", ".join(f"{limit:g} for {int(value)}" for value, limit in limits.items())
        parts.append(f"at most, by {other}, {listed}")
    elif None not in (low, high):
        parts.append(f"{low:g} to {high:g}")
    elif low is not None:
        parts.append(f"at least {low:g}")
    elif high is not None:
        parts.append(f"at most {high:g}")
    if field.also is not None:
        parts.append(f"or {field.also:g}")
    if field.reset and not isinstance(field.reset, bytes):
        parts.append(f"reset {field.label(field.reset)}")
    if field.range_flag:
        parts.append(f"else {field.range_flag}")
    if field.flag and field.flag != field.name:
        parts.append(f"shows {field.flag}")
    return "; ".join(parts)


def choice_rows(choices: Choices) -> list[str]:
    rows = [f"| {int(choice)} | {choice.name} |" for choice in choices]
    return ["| value | name |", "|-|-|", *rows]


def field_json(field: Field) -> dict[str, object]:
    by = field.choices_by
    return {
        **picked(field, "name", "type", "bit_offset", "byte_offset", "meaning", "unit", "scale"),
        "choices": _numbers(field.choices),
        "choices_by": by and (by[0], {at: _numbers(choices) for at, choices in by[1].items()}),
        **dict(zip(("minimum", "maximum"), field.ends, strict=True)),
        **{"also": field.also, "maximum_by": field.high_by},
        **picked(field, "range_flag", "flag"),
        "reset": field.reset.hex() if isinstance(field.reset, bytes) else field.reset,
    }


def _numbers(choices: Choices | None) -> dict[str, int] | None:
    return None if choices is None else {choice.name: int(choice) for choice in choices}


def picked(thing: object, *names: str) -> dict[str, object]:
    return {name: getattr(thing, name) for name in names}
