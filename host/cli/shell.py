"""A shell for a device's registers: read, write and watch by the tables' names.

TARGET is a serial port (/dev/ttyUSB0), tcp://HOST:PORT, rfc2217://HOST:PORT,
i2c:BUS:ADDR, emulated:DEVICE or recorded:FILE. Words complete with Tab; `help`
lists the commands. With -c or a script file, the first command that fails ends
the run: exit status 1 if the device failed, 2 if the command was invalid.

examples:
  cubestack shell emulated:{second}
  cubestack shell ./tty --device {first} -c 'read Identification'
  cubestack shell emulated:{second} --json -c 'write CaptureOnly SUN SRAM1 TOP;
      time 0.5; read Result1'
  cubestack shell i2c:7:0x1b --script commands.txt
  cubestack shell /dev/ttyUSB0 --device {second} --record bench.rec
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cubestack.firmware_model.formats.untrusted import read_text, shown_lines
from cubestack.host.cli.arguments import add_flag, add_path
from cubestack.host.cli.device_options import add_target_arguments, open_any_target
from cubestack.host.errors import HostError
from cubestack.host.shell.language import CommandResult, Shell
from cubestack.host.terminal import say

PROMPT = "{}> "
HISTORY_LINES = 1000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_target_arguments(parser)
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "-c",
        dest="commands",
        action="append",
        metavar="COMMANDS",
        help="commands separated by semicolons; repeatable",
    )
    add_path(source, "--script", "file with one command per line")
    add_flag(parser, "--json", "print one JSON object per command")


def run(args: argparse.Namespace) -> int:
    lines = _lines(args)
    with open_any_target(args.target, args, keep=False) as target:
        shell = Shell(target)

        def show(result: CommandResult) -> None:
            target.outputs.keep()  # the first command was right
            if args.json:
                print(json.dumps(result.data))
            else:
                _show_text(result)

        shell.on_row = (lambda _row: target.outputs.keep()) if args.json else show
        if lines is None and sys.stdin.isatty():
            target.outputs.keep()
            return _interactive(shell, show)
        for line in lines if lines is not None else sys.stdin:
            if line.strip() in ("quit", "exit"):
                break
            result = shell.execute(line)
            if result is not None:
                show(result)
        return 0


def _lines(args: argparse.Namespace) -> list[str] | None:
    if args.commands is not None:
        return [line for text in args.commands for line in split_commands(text)]
    if args.script is None:
        return None
    try:
        return list(read_text(args.script).splitlines())
    except OSError as error:
        raise ValueError(f"can not read script {args.script}: {error.strerror}") from None


def split_commands(text: str) -> Iterator[str]:
    """Commands between semicolons and line ends, but for those in quotes."""
    command, quote = "", ""
    for character in text:
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character in ";\n":
            yield command
            command = ""
            continue
        command += character
    yield command


def _show_text(result: CommandResult) -> None:
    width = max((len(name) for name, _ in result.rows), default=0)
    for name, text in result.rows:
        print(shown_lines(f"{name:<{width}}  {text}" if name else text))


def _interactive(shell: Shell, show: Callable[[CommandResult], None]) -> int:
    """Prompt for commands until the end of the input, and print errors."""
    say(f"{shell.target.interface.name} at {shell.target.name}; Tab completes, help lists")
    with _line_editor(shell):
        while True:
            try:
                line = input(PROMPT.format(shell.target.interface.name.lower()))
                if line.strip() in ("quit", "exit"):
                    return 0
                result = shell.execute(line)
                if result is not None:
                    show(result)
            except EOFError:
                print()
                return 0
            except KeyboardInterrupt:
                print()
            except (ValueError, HostError) as error:
                say(f"error: {error}")


@contextmanager
def _line_editor(shell: Shell) -> Iterator[None]:
    """Completion and history through the standard library's readline, where there is one."""
    try:
        import readline
    except ImportError:
        yield
        return
    found: list[str] = []

    def complete(_text: str, state: int) -> str | None:
        if state == 0:
            found[:] = shell.complete(readline.get_line_buffer()[: readline.get_endidx()])
        if state >= len(found):
            return None
        return found[state] + ("" if found[state].endswith("=") else " ")

    readline.set_completer(complete)
    readline.set_completer_delims(" ")
    libedit = "libedit" in (readline.__doc__ or "")
    readline.parse_and_bind("bind ^I rl_complete" if libedit else "tab: complete")
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state")
    history = state / "cubestack" / "history"
    with suppress(OSError):
        readline.read_history_file(history)
    readline.set_history_length(HISTORY_LINES)
    try:
        yield
    finally:
        with suppress(OSError):
            history.parent.mkdir(parents=True, exist_ok=True)
            readline.write_history_file(history)
