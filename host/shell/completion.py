"""What may stand where a line of the shell ends, by the tables of its target."""

from collections.abc import Iterable

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Kind
from cubestack.host.devices.targets import Target
from cubestack.host.shell.controls import LOG, ON_OFF
from cubestack.host.shell.names import Names


def complete(target: Target, names: Names, commands: Iterable[str], line: str) -> list[str]:
    """Words that may stand where ``line`` ends, in the order of the tables."""
    *before, word = line.split(" ")
    before = [part for part in before if part]
    candidates = _arguments(target, names, before) if before else list(commands)
    return [known for known in candidates if known.lower().startswith(word.lower())]


def _arguments(target: Target, names: Names, before: list[str]) -> list[str]:
    command, arguments = before[0], before[1:]
    controls = target.controls
    if command in ("read", "watch", "write", "list") and not arguments:
        return names.of(command)
    if command == "read" and len(arguments) == 1:
        return [f.name for f in names.fields(arguments[0], Kind.TELEMETRY)]
    if command == "write":
        given = {word.partition("=")[0].lower() for word in arguments[1:]}
        fields = names.fields(arguments[0], Kind.TELECOMMAND)
        return [
            f"{f.name}={v}"
            for f in fields
            if f.name.lower() not in given
            for v in (_choices(f) or [""])
        ]
    if command == "bench" and not arguments and target.interface.service_port is not None:
        return [letter.letter for letter in target.interface.service_port.letters]
    if command == "fault" and controls is not None:
        parameters = controls.fault_parameters.get(arguments[0], ()) if arguments else ()
        given = {word.partition("=")[0] for word in arguments[1:]}
        words = _next_words((*controls.faults, LOG), arguments)
        return words + [f"{name}=" for name in parameters if name not in given]
    if command == "power" and controls is not None:
        phrases = [f"{channel} {state}" for channel in controls.channels for state in ON_OFF]
        return _next_words(phrases, arguments)
    return []


def _choices(field: Field) -> list[str]:
    return [] if field.choices is None else [choice.name for choice in field.choices]


def _next_words(phrases: Iterable[str], before: list[str]) -> list[str]:
    """Words that may follow ``before`` in one of ``phrases``."""
    split = [phrase.split() for phrase in phrases]
    fitting = [words for words in split if words[: len(before)] == before]
    return list(dict.fromkeys(words[len(before)] for words in fitting if len(words) > len(before)))
