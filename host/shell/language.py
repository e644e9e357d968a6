"""The register shell's language: one command per line, with names from the tables.

Every command returns a ``CommandResult``: rows for people, data for programs. ``complete``
completes a line. An invalid line raises ShellError (a ValueError) before anything is sent; a
device's failure raises the client's errors.
"""

import shlex
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from cubestack.firmware_model.interface.codec.field import suggestion
from cubestack.firmware_model.interface.codec.message import MessageKind
from cubestack.host.clients.diagnosis import why_silent
from cubestack.host.errors import BadAnswerError, NoAnswerError
from cubestack.host.shell.controls import LOG, ON_OFF, ControlCommands
from cubestack.host.shell.names import CommandResult, Names, ShellCommand, ShellError, check_count
from cubestack.host.shell.ports import PortCommands
from cubestack.host.shell.registers import RegisterCommands
from cubestack.host.targets import Target

__all__ = ["CommandResult", "Shell", "ShellError"]

T = TypeVar("T")

HELP = "help [COMMAND|NAME]"


class Shell:
    """The commands on one target.

    Attributes:
        target: the target they act on.
        commands: by name.
        on_row: called with each result of ``watch`` as it comes.
    """

    def __init__(self, target: Target) -> None:
        self.target = target
        self._names = Names(target)
        self._answered = False
        self._silent_because: str | None = None
        self.on_row: Callable[[CommandResult], None] = lambda _result: None
        self._registers = RegisterCommands(target, self._names, lambda row: self.on_row(row))
        commands = [
            *self._registers.commands(),
            *PortCommands(target).commands(),
            *ControlCommands(target).commands(),
            ShellCommand(HELP, "this list, or what a command or name is", self._help),
            ShellCommand("quit", "end the shell; so do exit and Ctrl-D", lambda _: CommandResult()),
        ]
        self.commands = {command.name: command for command in commands}

    def execute(self, line: str, available: Sequence[str] | None = None) -> CommandResult | None:
        """Run one command; None for an empty line or a comment (#).

        ``available`` are the only commands that run, all without it.

        Raises ShellError, InterfaceError, TransportError, NodeError. If the node has never
        answered, the error includes the likely cause.
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
        if available is not None and name not in available:
            raise ShellError(f"{name} is not available here; available: {', '.join(available)}")
        command = self.commands[name]
        if command.emulated_only and self.target.controls is None:
            where = f"{self.target.name} is not emulated here"
            raise ShellError(f"{name}: {where}: use emulated:DEVICE, or --control URL")
        return self.asked(lambda: command.run(arguments))

    def asked(self, act: Callable[[], T]) -> T:
        """Result of ``act`` on the node; raises as ``execute`` does."""
        try:
            found = act()
        except (NoAnswerError, BadAnswerError) as error:
            why = self._why_silent()
            raise (type(error)(f"{error}; {why}") if why else error) from None
        self._answered = True
        return found

    def _why_silent(self) -> str:
        """Diagnosed once; it stays valid until an answer comes."""
        line = self.target.line
        if self._answered or line is None or self.target.registers is not None:
            return ""
        if self._silent_because is None:
            self._silent_because = why_silent(line, self.target.interface)
        return self._silent_because

    def complete(self, line: str) -> list[str]:
        *before, word = line.split(" ")
        before = [part for part in before if part]
        known = _arguments(self.target, self._names, before) if before else list(self.commands)
        return [found for found in known if found.lower().startswith(word.lower())]

    def _help(self, words: list[str]) -> CommandResult:
        check_count(HELP, words, 0, 1)
        if words and words[0] not in self.commands:
            return self._registers.describe(words[0])
        shown = [self.commands[word] for word in words] or list(self.commands.values())
        rows = [
            (command.usage, command.meaning + (" (emulated:)" if command.emulated_only else ""))
            for command in shown
        ]
        return CommandResult(rows, {"commands": [command.name for command in shown]})


def _arguments(target: Target, names: Names, before: list[str]) -> list[str]:
    command, arguments = before[0], before[1:]
    controls = target.controls
    if command in ("read", "watch", "write", "list", "help") and not arguments:
        return names.of("list" if command == "help" else command)
    if command == "read" and len(arguments) == 1:
        return [f.name for f in names.fields(arguments[0], MessageKind.TELEMETRY)]
    if command == "write":
        given = {word.partition("=")[0].lower() for word in arguments[1:]}
        fields = names.fields(arguments[0], MessageKind.TELECOMMAND)
        return [
            f"{f.name}={v}"
            for f in fields
            if f.name.lower() not in given
            for v in ([choice.name for choice in f.choices or ()] or [""])
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


def _next_words(phrases: Iterable[str], before: list[str]) -> list[str]:
    """Words that can follow ``before`` in any of ``phrases``."""
    split = [phrase.split() for phrase in phrases]
    fitting = [words for words in split if words[: len(before)] == before]
    return list(dict.fromkeys(words[len(before)] for words in fitting if len(words) > len(before)))
