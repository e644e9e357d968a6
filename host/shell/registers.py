"""The shell's commands on messages and registers: read, write, watch, dump, list."""

from collections.abc import Callable
from itertools import count

from cubestack.firmware_model.interface.codec.field import Field, Value
from cubestack.firmware_model.interface.codec.message import Kind
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.host.devices.targets import Target
from cubestack.host.errors import NodeError
from cubestack.host.export.field_text import field_details, field_type
from cubestack.host.shell.names import Names, number_of
from cubestack.host.shell.result import (
    Result,
    ShellCommand,
    ShellError,
    check_count,
    plain,
    to_number,
)
from cubestack.host.shell.values import parse_value, parse_values

WATCH_PERIOD_S = 1.0
WATCH_COUNT = 10
PROCESSING_TIMEOUT_S = 10.0

READ = "read NAME [FIELD]"
WRITE = "write NAME [FIELD=]VALUE ..."
WATCH = f"watch NAME [COUNT={WATCH_COUNT} [PERIOD_S={WATCH_PERIOD_S:g}]]"
DUMP = "dump"
LIST = "list [NAME]"


class RegisterCommands:
    """The commands on one target.

    Attributes:
        on_row: called with each result of ``watch`` as it comes.
    """

    def __init__(self, target: Target, names: Names) -> None:
        """Use ``target``, which stays its owner's."""
        self.on_row: Callable[[Result], None] = lambda _result: None
        self._target = target
        self._names = names

    def commands(self) -> list[ShellCommand]:
        """What they are called."""
        return [
            ShellCommand(READ, "a telemetry frame or register; NAME may be a number", self._read),
            ShellCommand(WRITE, "send a telecommand, write a register", self._write),
            ShellCommand(WATCH, "read again and again", self._watch),
            ShellCommand(DUMP, "read all telemetry that has no side effect", self._dump),
            ShellCommand(LIST, "what there is, or the fields of one", self._list),
        ]

    def _read(self, words: list[str]) -> Result:
        check_count(READ, words, 1, 2)
        found = self._names.need("read", words[0], Kind.TELEMETRY)
        if isinstance(found, PointerRegister):
            return self._read_register(found)
        values = self._target.node.telemetry(found.name)
        fields = found.fields
        if len(words) == 2:
            fields = (found.field(words[1]),)
        return Result(
            [(f.name, f.label(values[f.name])) for f in fields],
            {"name": found.name, "values": {f.name: plain(values[f.name]) for f in fields}},
        )

    def _read_register(self, register: PointerRegister) -> Result:
        assert self._target.registers is not None
        if register.streams:
            data: Value = self._target.registers.read_stream(register.name)
            text = f"{register.length} bytes"
        else:
            data = self._target.registers.read(register.name)
            text = register.field.label(data)
        return Result(
            [(register.name, text)], {"name": register.name, "values": {register.name: plain(data)}}
        )

    def _write(self, words: list[str]) -> Result:
        if not words:
            raise ShellError(f"usage: {WRITE}")
        found = self._names.need("write", words[0], Kind.TELECOMMAND)
        values = words[1:]
        if isinstance(found, PointerRegister):
            check_count(f"write {found.name} VALUE", values, 1, 1)
            assert self._target.registers is not None
            text = values[0].partition("=")[2] or values[0]
            self._target.registers.write(found.name, parse_value(found.field, text))
        else:
            self._target.node.command(found.name, **parse_values(found, values))
            if any(m.name == "TcmdProcessed" for m in self._target.interface.telemetries):
                self._target.node.wait_processed(PROCESSING_TIMEOUT_S)
        return Result([("", f"{found.name}: done")], {"name": found.name, "done": True})

    def _watch(self, words: list[str]) -> Result:
        check_count(WATCH, words, 1, 3)
        found = self._names.need("watch", words[0], Kind.TELEMETRY)
        times = to_number("watch", words[1], 1) if len(words) > 1 else WATCH_COUNT
        period_s = to_number("watch", words[2], 0) if len(words) > 2 else WATCH_PERIOD_S
        readings = []
        for number in count(1):
            result = self._read(words[:1])
            readings.append(result.data["values"])
            self.on_row(result)
            if number >= times:
                return Result([], {"name": found.name, "readings": readings})
            self._target.node.pause(period_s)
        raise AssertionError

    def _dump(self, words: list[str]) -> Result:
        check_count(DUMP, words, 0, 0)
        result = Result()
        frames: dict[str, object] = {}
        registers: dict[str, object] = {}
        for message in self._target.interface.telemetries:
            if not message.supported or message.has_side_effect:
                continue
            try:
                values = self._target.node.telemetry(message.name)
            except NodeError as error:
                result.rows.append((message.name, f"({error})"))
                frames[message.name] = None
                continue
            rows = [(f"{message.name}.{f.name}", f.label(values[f.name])) for f in message.fields]
            result.rows += rows
            frames[message.name] = {name: plain(value) for name, value in values.items()}
        for register in self._names.registers:
            if register.readable and not register.streams:
                one = self._read_register(register)
                result.rows += one.rows
                registers |= one.data["values"]
        result.data = {"telemetry": frames, "registers": registers}
        return result

    def _list(self, words: list[str]) -> Result:
        check_count(LIST, words, 0, 1)
        if words:
            return self._list_one(words[0])
        found = self._names.all_of("list")
        rows = [(number_of(one), one.name) for one in found]
        return Result(rows, {"names": [one.name for one in found]})

    def _list_one(self, name: str) -> Result:
        found = self._names.need("list", name, Kind.TELEMETRY, Kind.TELECOMMAND)
        if isinstance(found, PointerRegister):
            what = f"register {found.address:#04x}, {found.access.value}"
            fields: tuple[Field, ...] = (found.field,)
        else:
            what = f"{found.kind.value} {found.id}, {found.length} bytes: {found.meaning}"
            fields = found.fields
        rows = [(f.name, f"{field_type(f)}: {field_details(f)}") for f in fields]
        return Result([("", what), *rows], {"name": found.name, "fields": [f.name for f in fields]})
