"""Values as a user types them, by the fields of the interface tables."""

from collections.abc import Sequence

from cubestack.firmware_model.interface.codec.field import Field, InterfaceError
from cubestack.firmware_model.interface.codec.message import Message


def parse_value(field: Field, text: str) -> object:
    """A number (decimal, 0x, 0b), a choice's name, true or false, or hexadecimal bytes.

    Raises InterfaceError.
    """
    if field.type.startswith("bytes"):
        try:
            return bytes.fromhex(text)
        except ValueError:
            raise InterfaceError(f"field {field.name}: {text!r} is not hexadecimal") from None
    if text.lower() in ("true", "false", "on", "off"):
        return int(text.lower() in ("true", "on"))
    for convert in (lambda word: int(word, 0), float):
        try:
            return convert(text)
        except ValueError:
            continue
    return text  # the name of a choice, or what ``pack`` refuses with the right words


def parse_values(message: Message, words: Sequence[str]) -> dict[str, object]:
    """Parameters of a telecommand: FIELD=VALUE in any order, or the values in the table's order.

    A field that is not given keeps no value: InterfaceError, as for one that does not exist.
    """
    values: dict[str, object] = {}
    for position, word in enumerate(words):
        name, separator, text = word.partition("=")
        if separator:
            field = message.field(name)
        elif position < len(message.fields):
            field, text = message.fields[position], word
        else:
            raise InterfaceError(
                f"{message.name} has {len(message.fields)} fields, not {len(words)}"
            )
        if field.name in values:
            raise InterfaceError(f"{message.name}: {field.name} is given twice")
        values[field.name] = parse_value(field, text)
    return values
