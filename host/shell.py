"""The register shell's language: one line is one command, its words come from the tables.

Every command gives a ``Result``: rows for a reader, and data for a program. What can be completed
is in ``complete``. A line that makes no sense raises ShellError, a ValueError, before anything is
sent; what a device does not do raises the client's errors.
"""

import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubesense_telemetry import SCHEDULES
from cubestack.firmware_model.interface.field import Field, Value, suggestion
from cubestack.firmware_model.interface.message import Kind, Message
from cubestack.firmware_model.interface.register_pointer import PointerRegister
from cubestack.host.errors import NodeError
from cubestack.host.field_text import field_details, field_type
from cubestack.host.shell_picture import download
from cubestack.host.shell_values import parse_value, parse_values
from cubestack.host.targets import Controls, Target

__all__ = [
    "SCHEDULING",
    "Command",
    "Result",
    "Shell",
    "ShellError",
    "has_side_effect",
    "plain",
]

RAW_TIMEOUT_S = 0.3
"""Silence after which the answer to raw bytes is over."""

READ_BYTES = 4096
ON_OFF = ("on", "off")
WATCH_PERIOD_S = 1.0
WATCH_COUNT = 10
PROCESSING_TIMEOUT_S = 10.0

SCHEDULING = {CUBESENSE.telemetry(identifier).name for identifier in SCHEDULES}
"""Telemetry that starts a measurement when it is read."""


class ShellError(ValueError):
    """A line makes no sense; the text is one line and says what would."""


@dataclass
class Result:
    """What a command found.

    Attributes:
        rows: (name, value for a reader); a name may be empty.
        data: the same for a program, as JSON takes it.
    """

    rows: list[tuple[str, str]] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Command:
    """A command of the shell: how it is called, what it does, and what it needs."""

    usage: str
    meaning: str
    run: Callable[[list[str]], Result]
    emulated_only: bool = False


class Shell:
    """The commands on one target.

    Attributes:
        target: what they act on.
        commands: by name.
        on_row: called with each result of ``watch`` as it comes.
    """

    def __init__(self, target: Target) -> None:
        """Use ``target``, which stays its owner's."""
        self.target = target
        self.on_row: Callable[[Result], None] = lambda _result: None
        self.commands = {
            "read": Command("read NAME [FIELD]", "a telemetry frame or register", self._read),
            "write": Command(
                "write NAME [FIELD=]VALUE ...", "send a telecommand, write a register", self._write
            ),
            "watch": Command(
                f"watch NAME [COUNT={WATCH_COUNT} [PERIOD_S={WATCH_PERIOD_S:g}]]",
                "read again and again",
                self._watch,
            ),
            "dump": Command("dump", "read all telemetry that has no side effect", self._dump),
            "list": Command("list [NAME]", "what there is, or the fields of one", self._list),
            "image": Command("image FILE.png [SOURCE]", "download the picture", self._image),
            "bench": Command("bench LETTER", "a letter of the bench protocol", self._bench),
            "raw": Command("raw HEX ...", "send bytes, show what comes", self._raw),
            "scene": Command("scene FILE", "show another scene", self._scene, True),
            "fault": Command(
                "fault [KIND [TARGET] [PARAMETER=VALUE ...] [for_s=SECONDS]]",
                "let something break; fault clear ends it",
                self._fault,
                True,
            ),
            "power": Command(
                "power [CHANNEL on|off]", "supply currents, load switches", self._power, True
            ),
            "time": Command("time [SECONDS]", "virtual time; let it pass", self._time, True),
            "help": Command("help", "this list", self._help),
        }

    def execute(self, line: str) -> Result | None:
        """Run one command; None for an empty line or a comment (#).

        Raises ShellError, InterfaceError, TransportError, NodeError.
        """
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            raise ShellError(f"{line.strip()!r}: {error}") from None
        if not words:
            return None
        name, *arguments = words
        if name not in self.commands:
            raise ShellError(f"no command {name!r}; {suggestion(name, list(self.commands))}")
        command = self.commands[name]
        if command.emulated_only and self.target.controls is None:
            raise ShellError(
                f"{name}: {self.target.name} is not emulated here: use emulated:DEVICE"
            )
        return command.run(arguments)

    def complete(self, line: str) -> list[str]:
        """Words that may stand where ``line`` ends, in the order of the tables."""
        *before, word = line.split(" ")
        before = [part for part in before if part]
        return [known for known in self._candidates(before) if _matches(known, word)]

    def _candidates(self, before: list[str]) -> list[str]:
        if not before:
            return list(self.commands)
        command, arguments = before[0], before[1:]
        controls = self.target.controls
        if command in ("read", "watch", "write", "list") and not arguments:
            return self._names(command)
        if command == "read" and len(arguments) == 1:
            return [f.name for f in self._fields(arguments[0], Kind.TELEMETRY)]
        if command == "write":
            given = {word.partition("=")[0].lower() for word in arguments[1:]}
            fields = self._fields(arguments[0], Kind.TELECOMMAND)
            return [
                f"{f.name}={v}"
                for f in fields
                if f.name.lower() not in given
                for v in (_choices(f) or [""])
            ]
        if command == "bench" and not arguments and self.target.interface.bench is not None:
            return [letter.letter for letter in self.target.interface.bench.letters]
        if command == "fault" and controls is not None:
            return _next_words(controls.faults, arguments)
        if command == "power" and controls is not None:
            phrases = [f"{channel} {state}" for channel in controls.channels for state in ON_OFF]
            return _next_words(tuple(phrases), arguments)
        return []

    def _names(self, command: str) -> list[str]:
        interface = self.target.interface
        names = []
        if command != "write":
            names += [message.name for message in interface.telemetries if message.supported]
        if command in ("write", "list"):
            names += [message.name for message in interface.telecommands if message.supported]
        if self.target.registers is not None:
            for register in self.target.registers.registers:
                wanted = register.writable if command == "write" else register.readable
                names += [register.name] if wanted or command == "list" else []
        return names

    def _fields(self, name: str, kind: Kind) -> tuple[Field, ...]:
        found = self._find(name, kind)
        if found is None:
            return ()
        return found.fields if isinstance(found, Message) else (found.field,)

    def _find(self, name: str, *kinds: Kind) -> Message | PointerRegister | None:
        for message in self.target.interface.messages:
            if message.kind in kinds and message.name.lower() == name.lower():
                return message
        for register in self._registers():
            if register.name.lower() == name.lower():
                return register
        return None

    def _registers(self) -> list[PointerRegister]:
        registers = self.target.registers
        return [] if registers is None else list(registers.registers)

    def _need(self, command: str, name: str, *kinds: Kind) -> Message | PointerRegister:
        found = self._find(name, *kinds)
        if found is None:
            known = self._names(command)
            raise ShellError(f"{command}: nothing is called {name!r}; {suggestion(name, known)}")
        return found

    # --- the commands ----------------------------------------------------------------------------

    def _read(self, words: list[str]) -> Result:
        _check_count("read", self.commands["read"].usage, words, 1, 2)
        found = self._need("read", words[0], Kind.TELEMETRY)
        if isinstance(found, PointerRegister):
            return self._read_register(found)
        values = self.target.node.telemetry(found.name)
        fields = found.fields
        if len(words) == 2:
            fields = (found.field(words[1]),)
        return Result(
            [(f.name, f.label(values[f.name])) for f in fields],
            {"name": found.name, "values": {f.name: plain(values[f.name]) for f in fields}},
        )

    def _read_register(self, register: PointerRegister) -> Result:
        assert self.target.registers is not None
        if register.streams:
            data: Value = self.target.registers.read_stream(register.name)
            text = f"{register.length} bytes"
        else:
            data = self.target.registers.read(register.name)
            text = register.field.label(data)
        return Result(
            [(register.name, text)],
            {"name": register.name, "values": {register.name: plain(data)}},
        )

    def _write(self, words: list[str]) -> Result:
        if not words:
            raise ShellError(f"usage: {self.commands['write'].usage}")
        found = self._need("write", words[0], Kind.TELECOMMAND)
        values = words[1:]
        if isinstance(found, PointerRegister):
            _check_count("write", f"write {found.name} VALUE", values, 1, 1)
            assert self.target.registers is not None
            text = values[0].partition("=")[2] or values[0]
            self.target.registers.write(found.name, parse_value(found.field, text))
        else:
            self.target.node.command(found.name, **parse_values(found, values))
            if any(m.name == "TcmdProcessed" for m in self.target.interface.telemetries):
                self.target.node.wait_processed(PROCESSING_TIMEOUT_S)
        return Result([("", f"{found.name}: done")], {"name": found.name, "done": True})

    def _watch(self, words: list[str]) -> Result:
        usage = self.commands["watch"].usage
        _check_count("watch", usage, words, 1, 3)
        self._need("watch", words[0], Kind.TELEMETRY)
        times = _number("watch", words[1], 1) if len(words) > 1 else WATCH_COUNT
        period_s = _number("watch", words[2], 0) if len(words) > 2 else WATCH_PERIOD_S
        found = []
        for number in count(1):
            result = self._read(words[:1])
            found.append(result.data["values"])
            self.on_row(result)
            if number >= times:
                return Result([], {"name": words[0], "readings": found})
            self.target.node.pause(period_s)
        raise AssertionError

    def _dump(self, words: list[str]) -> Result:
        _check_count("dump", "dump", words, 0, 0)
        result = Result()
        frames: dict[str, object] = {}
        registers: dict[str, object] = {}
        for message in self.target.interface.telemetries:
            if not message.supported or has_side_effect(message):
                continue
            try:
                values = self.target.node.telemetry(message.name)
            except NodeError as error:
                result.rows.append((message.name, f"({error})"))
                frames[message.name] = None
                continue
            rows = [(f"{message.name}.{f.name}", f.label(values[f.name])) for f in message.fields]
            result.rows += rows
            frames[message.name] = {name: plain(value) for name, value in values.items()}
        for register in self._registers():
            if register.readable and not register.streams:
                one = self._read_register(register)
                result.rows += one.rows
                registers |= one.data["values"]
        result.data = {"telemetry": frames, "registers": registers}
        return result

    def _list(self, words: list[str]) -> Result:
        _check_count("list", "list [NAME]", words, 0, 1)
        if words:
            return self._list_one(words[0])
        names = self._names("list")
        return Result([("", name) for name in names], {"names": names})

    def _list_one(self, name: str) -> Result:
        found = self._need("list", name, Kind.TELEMETRY, Kind.TELECOMMAND)
        if isinstance(found, PointerRegister):
            what = f"register {found.address:#04x}, {found.access.value}"
            fields: tuple[Field, ...] = (found.field,)
        else:
            what = f"{found.kind.value} {found.id}, {found.length} bytes: {found.meaning}"
            fields = found.fields
        rows = [(f.name, f"{field_type(f)}: {field_details(f)}") for f in fields]
        return Result([("", what), *rows], {"name": found.name, "fields": [f.name for f in fields]})

    def _image(self, words: list[str]) -> Result:
        _check_count("image", self.commands["image"].usage, words, 1, 2)
        path = Path(words[0])
        if path.suffix.lower() != ".png":
            raise ShellError(f"image: {path} must end in .png")
        shape = download(self.target, path, words[1] if len(words) > 1 else None)
        rows, columns = shape
        return Result(
            [("", f"{path}: {columns} x {rows}")],
            {"file": str(path), "columns": columns, "rows": rows},
        )

    def _bench(self, words: list[str]) -> Result:
        _check_count("bench", "bench LETTER", words, 1, 1)
        protocol, line = self.target.interface.bench, self.target.bench
        if protocol is None:
            raise ShellError(f"bench: {self.target.interface.name} has no bench protocol")
        if line is None:
            raise ShellError("bench: no line with the bench protocol is open: give --bench TARGET")
        wanted = words[0].encode("utf-8")
        letter = protocol.find(wanted[0]) if len(wanted) == 1 else None
        if letter is None:
            known = ", ".join(f"{known.letter} ({known.name})" for known in protocol.letters)
            raise ShellError(f"bench: no letter {words[0]!r}; known: {known}")
        line.write(letter.request)
        answer = bytearray()
        while len(answer) < letter.length:
            data = line.read(READ_BYTES, PROCESSING_TIMEOUT_S)
            if not data:
                break
            answer += data
        whole = len(answer) == letter.length
        text = (
            repr(answer.decode("latin-1")) if whole and len(answer) < 9 else f"{len(answer)} bytes"
        )
        note = "" if whole else f" of {letter.length}"
        return Result(
            [(letter.name, text + note)], {"letter": letter.letter, "answer": answer.hex()}
        )

    def _raw(self, words: list[str]) -> Result:
        line = self.target.line
        if line is None:
            raise ShellError(f"raw: {self.target.name} is no serial line")
        try:
            data = bytes.fromhex("".join(words))
        except ValueError:
            raise ShellError(f"raw: {' '.join(words)!r} is not hexadecimal bytes") from None
        if not data:
            raise ShellError(f"usage: {self.commands['raw'].usage}")
        line.write(data)
        answer = bytearray()
        while more := line.read(READ_BYTES, RAW_TIMEOUT_S):
            answer += more
        return Result([("", answer.hex(" ") or "(nothing)")], {"answer": answer.hex()})

    def _scene(self, words: list[str]) -> Result:
        _check_count("scene", "scene FILE", words, 1, 1)
        self._controls().scene(Path(words[0]))
        return Result([("", f"scene {words[0]}")], {"scene": words[0]})

    def _fault(self, words: list[str]) -> Result:
        controls = self._controls()
        if not words:
            return Result([("", fault) for fault in controls.faults], {"faults": controls.faults})
        controls.fault(words)
        return Result([("", f"fault: {' '.join(words)}")], {"fault": " ".join(words)})

    def _power(self, words: list[str]) -> Result:
        controls = self._controls()
        if words:
            if len(words) != 2 or words[1] not in ("on", "off"):
                raise ShellError(f"usage: {self.commands['power'].usage}")
            controls.switch(words[0], words[1] == "on")
        currents = controls.currents()
        rows = [(name, f"{current:.1f} mA") for name, current in currents.items()]
        return Result(rows, {"currents_ma": currents})

    def _time(self, words: list[str]) -> Result:
        _check_count("time", self.commands["time"].usage, words, 0, 1)
        controls = self._controls()
        if words:
            controls.advance(_number("time", words[0], 0))
        now_s = controls.time_s()
        return Result([("time", f"{now_s:.6f} s")], {"time_s": now_s})

    def _help(self, _words: list[str]) -> Result:
        rows = [
            (command.usage, command.meaning + (" (emulated:)" if command.emulated_only else ""))
            for command in self.commands.values()
        ]
        return Result(rows, {"commands": list(self.commands)})

    def _controls(self) -> Controls:
        assert self.target.controls is not None
        return self.target.controls


def has_side_effect(message: Message) -> bool:
    """Whether reading a telemetry frame changes something in the node."""
    return message.steps or message.name in SCHEDULING


def plain(value: Value) -> object:
    """A value as JSON takes it: bytes in hexadecimal."""
    return value.hex() if isinstance(value, bytes) else value


def _matches(known: str, word: str) -> bool:
    return known.lower().startswith(word.lower())


def _choices(field: Field) -> list[str]:
    return [] if field.choices is None else [choice.name for choice in field.choices]


def _next_words(phrases: tuple[str, ...], before: list[str]) -> list[str]:
    """Words that may follow ``before`` in one of ``phrases``."""
    split = [phrase.split() for phrase in phrases]
    fitting = [words for words in split if words[: len(before)] == before]
    return list(dict.fromkeys(words[len(before)] for words in fitting if len(words) > len(before)))


def _check_count(command: str, usage: str, words: list[str], least: int, most: int) -> None:
    if not least <= len(words) <= most:
        raise ShellError(f"{command}: {len(words)} words; usage: {usage}")


def _number(command: str, text: str, least: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = least - 1
    if not least <= value < 1e9:
        raise ShellError(f"{command}: {text!r} is not a number of at least {least:g}")
    return value
