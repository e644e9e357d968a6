"""The register shell's language: one line is one command, its words come from the tables.

Every command gives a ``Result``: rows for a reader, and data for a program. What can be completed
is in ``complete``. A line that makes no sense raises ShellError, a ValueError, before anything is
sent; what a device does not do raises the client's errors.
"""

import shlex
from collections.abc import Callable

from cubestack.firmware_model.interface.codec.field import suggestion
from cubestack.host.devices.targets import Target
from cubestack.host.shell.completion import complete
from cubestack.host.shell.controls import ControlCommands
from cubestack.host.shell.names import Names
from cubestack.host.shell.ports import PortCommands
from cubestack.host.shell.registers import RegisterCommands
from cubestack.host.shell.result import Result, ShellCommand, ShellError

__all__ = ["Result", "Shell", "ShellError"]


class Shell:
    """The commands on one target.

    Attributes:
        target: what they act on.
        commands: by name.
    """

    def __init__(self, target: Target) -> None:
        """Use ``target``, which stays its owner's."""
        self.target = target
        self._names = Names(target)
        self._registers = RegisterCommands(target, self._names)
        commands = [
            *self._registers.commands(),
            *PortCommands(target).commands(),
            *ControlCommands(target).commands(),
            ShellCommand("help", "this list", self._help),
        ]
        self.commands = {command.name: command for command in commands}

    @property
    def on_row(self) -> Callable[[Result], None]:
        """Called with each result of ``watch`` as it comes."""
        return self._registers.on_row

    @on_row.setter
    def on_row(self, tell: Callable[[Result], None]) -> None:
        self._registers.on_row = tell

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
        return complete(self.target, self._names, self.commands, line)

    def _help(self, _words: list[str]) -> Result:
        rows = [
            (command.usage, command.meaning + (" (emulated:)" if command.emulated_only else ""))
            for command in self.commands.values()
        ]
        return Result(rows, {"commands": list(self.commands)})
