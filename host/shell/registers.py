"""Shell commands on messages and registers: read, write, watch, dump, list."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count, groupby

from cubestack.firmware_model.interface.codec.field import Field, InterfaceError, Value
from cubestack.firmware_model.interface.codec.message import Message, MessageKind
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.host.errors import NodeError
from cubestack.host.export.field_text import field_details, field_type
from cubestack.host.shell.names import (
    CommandResult,
    Found,
    Names,
    ShellCommand,
    ShellError,
    check_count,
    number_of,
    to_number,
)
from cubestack.host.targets import Target

WATCH_PERIOD_S = 1.0
WATCH_COUNT = 10
PROCESSING_TIMEOUT_S = 10.0

READ = "read NAME [FIELD]"
WRITE = "write NAME [FIELD=]VALUE ..."
WATCH = f"watch NAME [COUNT={WATCH_COUNT} [PERIOD_S={WATCH_PERIOD_S:g}]]"
DUMP = "dump"
LIST = "list [NAME]"


@dataclass
class RegisterCommands:
    """The commands on one target; the caller closes it."""

    target: Target
    names: Names  #: what the target has
    on_row: Callable[[CommandResult], None]  #: called with each result of ``watch`` as it comes

    def commands(self) -> list[ShellCommand]:
        return [
            ShellCommand(
                READ, "read a telemetry frame or register; NAME can be a number", self._read
            ),
            ShellCommand(WRITE, "send a telecommand, write a register", self._write),
            ShellCommand(WATCH, "read repeatedly, with times", self._watch),
            ShellCommand(DUMP, "read all telemetry that has no side effect", self._dump),
            ShellCommand(LIST, "list all names, or the fields of one", self._list),
        ]

    def _read(self, words: list[str]) -> CommandResult:
        check_count(READ, words, 1, 2)
        found = self.names.need("read", words[0], MessageKind.TELEMETRY)
        if isinstance(found, PointerRegister):
            return self._read_register(found)
        values = self.target.node.telemetry(found.name)
        fields = (found.field(words[1]),) if len(words) == 2 else found.fields
        return CommandResult(
            [(f.name, f.label(values[f.name])) for f in fields],
            {"name": found.name, "values": {f.name: _plain(values[f.name]) for f in fields}},
        )

    def _read_register(self, register: PointerRegister) -> CommandResult:
        assert self.target.registers is not None
        if register.streams:
            data: Value = self.target.registers.read_stream(register.name)
            text = f"{register.length} bytes"
        else:
            data = self.target.registers.read(register.name)
            text = register.field.label(data)
        values = {register.name: _plain(data)}
        return CommandResult([(register.name, text)], {"name": register.name, "values": values})

    def _write(self, words: list[str]) -> CommandResult:
        if not words:
            raise ShellError(f"usage: {WRITE}")
        found = self.names.need("write", words[0], MessageKind.TELECOMMAND)
        values = words[1:]
        if isinstance(found, PointerRegister):
            check_count(f"write {found.name} VALUE", values, 1, 1)
            assert self.target.registers is not None
            text = values[0].partition("=")[2] or values[0]
            self.target.registers.write(found.name, parse_value(found.field, text))
        else:
            self.target.node.command(found.name, **parse_values(found, values))
            if any(m.name == "TcmdProcessed" for m in self.target.interface.telemetries):
                self.target.node.wait_processed(PROCESSING_TIMEOUT_S)
        return CommandResult([("", f"{found.name}: done")], {"name": found.name, "done": True})

    def _watch(self, words: list[str]) -> CommandResult:
        check_count(WATCH, words, 1, 3)
        found = self.names.need("watch", words[0], MessageKind.TELEMETRY)
        times = to_number("watch", words[1], 1) if len(words) > 1 else WATCH_COUNT
        period_s = to_number("watch", words[2], 0) if len(words) > 2 else WATCH_PERIOD_S
        readings, times_s = [], []
        begun_s = self._now_s()
        for number in count(1):
            result = self._read(words[:1])
            times_s.append(self._now_s() - begun_s)
            readings.append(result.data["values"])
            result.rows.insert(0, ("", f"after {times_s[-1]:.3f} s"))
            self.on_row(result)
            if number >= times:
                data = {"name": found.name, "readings": readings, "times_s": times_s}
                return CommandResult([], data)
            self.target.node.pause(period_s)
        raise AssertionError

    def _now_s(self) -> float:
        """Virtual time of a device that is emulated here, else the time of this machine."""
        controls = self.target.controls
        return time.monotonic() if controls is None else controls.time_s()

    def _dump(self, words: list[str]) -> CommandResult:
        check_count(DUMP, words, 0, 0)
        result = CommandResult()
        frames: dict[str, object] = {}
        registers: dict[str, object] = {}
        for message in self.target.interface.telemetries:
            if not message.supported or message.has_side_effect:
                continue
            try:
                values = self.target.node.telemetry(message.name)
            except NodeError as error:
                result.rows.append((message.name, f"({error})"))
                frames[message.name] = None
                continue
            result.rows += [
                (f"{message.name}.{f.name}", f.label(values[f.name])) for f in message.fields
            ]
            frames[message.name] = {name: _plain(value) for name, value in values.items()}
        for register in self.names.registers:
            if register.readable and not register.streams:
                one = self._read_register(register)
                result.rows += one.rows
                registers |= one.data["values"]
        result.data = {"telemetry": frames, "registers": registers}
        return result

    def _list(self, words: list[str]) -> CommandResult:
        check_count(LIST, words, 0, 1)
        if words:
            return self._list_one(words[0])
        found = self.names.all_of("list")
        rows: list[tuple[str, str]] = []
        for title, ones in groupby(found, _title):
            rows += [("", title), *((number_of(one), one.name) for one in ones)]
        return CommandResult(rows, {"names": [one.name for one in found]})

    def describe(self, name: str) -> CommandResult:
        """What a message or register is, in one line, and the names of its fields."""
        what, fields = self._described("help", name)
        names = [f.name for f in fields]
        return CommandResult([("", what), ("", ", ".join(names))], {"fields": names})

    def _described(self, command: str, name: str) -> tuple[str, tuple[Field, ...]]:
        found = self.names.need(command, name, MessageKind.TELEMETRY, MessageKind.TELECOMMAND)
        if isinstance(found, PointerRegister):
            return f"register {found.address:#04x}, {found.access.value}", (found.field,)
        text = f"{found.kind.value} {found.id}, {found.length} bytes: {found.meaning}"
        return text, found.fields

    def _list_one(self, name: str) -> CommandResult:
        found = self.names.need("list", name, MessageKind.TELEMETRY, MessageKind.TELECOMMAND)
        what, fields = self._described("list", name)
        rows = [(f.name, f"{field_type(f)}: {field_details(f)}") for f in fields]
        return CommandResult(
            [("", what), *rows], {"name": found.name, "fields": [f.name for f in fields]}
        )


def _title(found: Found) -> str:
    return "register:" if isinstance(found, PointerRegister) else f"{found.kind.value}:"


def _plain(value: Value) -> object:
    """A value as JSON takes it: bytes in hexadecimal."""
    return value.hex() if isinstance(value, bytes) else value


def parse_value(field: Field, text: str) -> object:
    """A number (also 0x, 0b), choice, true or false, hexadecimal bytes; raises InterfaceError."""
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
    return text  # the name of a choice, or an error that ``pack`` words


def parse_values(message: Message, words: Sequence[str]) -> dict[str, object]:
    """Parameters of a telecommand: FIELD=VALUE in any order, or the values in the table's order.

    Raises InterfaceError for a missing or an unknown field.
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
