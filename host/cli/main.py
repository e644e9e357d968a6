"""Entry point of the ``cubestack`` command.

Exit status: 0 done, 1 the run failed, 2 the call was wrong, 128 plus the signal's number when a
signal ended it. An error is one line: what, where, and what would be right.
"""

import gc
import logging
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from io import TextIOWrapper

from cubestack.firmware_model.formats.untrusted import shown_lines
from cubestack.host.cli.arguments import Parser, one_line
from cubestack.host.cli.commands import BUILT_IN, Listed, commands, reports, with_headings
from cubestack.host.devices.registry import device_names
from cubestack.host.terminal import hush, say

DONE, FAILED, WRONG_CALL = 0, 1, 2
SIGNALLED = 128

LEVELS = (logging.WARNING, logging.INFO, logging.DEBUG)
"""Of the log, by the number of times that --verbose stands there."""


def make_parser(asked: str | None = None) -> Parser:
    """The parser of the command line.

    With ``asked``, only that one is declared if there is one of that name, and no arguments until
    they are needed.
    """
    parser = Parser(
        prog="cubestack",
        description="Firmware-in-the-loop emulator of CubeSat camera sensors.",
        epilog=_with_names("Try: cubestack measure {first}, or cubestack COMMAND --help"),
    )
    parser.add_argument("--version", action="version", version=f"cubestack {version('cubestack')}")
    loud = parser.add_mutually_exclusive_group()
    loud.add_argument(
        "-v", "--verbose", action="count", default=0, help="log progress; -vv logs everything"
    )
    loud.add_argument(
        "-q", "--quiet", action="store_true", help="print results and errors only, no progress"
    )
    place = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    known: dict[str, Listed] = dict(BUILT_IN)
    if asked not in BUILT_IN:
        known |= commands() | {**reports()}
    if asked in known:
        known = {asked: known[asked]}
    for heading, name, command in with_headings(known):
        place.add_parser(name, help=command.summary, declare=partial(_declare, command))
        place._choices_actions[-1].heading = heading  # type: ignore[attr-defined]
    return parser if asked is not None else parser.all_declared()


def _declare(command: Listed, parser: Parser) -> None:
    loaded = command.load()
    parser.description = _with_names(loaded.__doc__ or "")
    loaded.add_arguments(parser)
    parser.set_defaults(run=loaded.run)


def _with_names(text: str) -> str:
    for place, name in zip(("{first}", "{second}", "{third}"), device_names(), strict=False):
        text = text.replace(place, name)
    return text


def _end_in_order() -> None:
    """Have signals that end a process close what is open: ports, links, processes of its own."""

    def end(number: int, _frame: object) -> None:
        raise SystemExit(SIGNALLED + number)

    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:  # not that of nohup
            signal.signal(number, end)


def _write_anywhere() -> None:
    """Have a locale without our letters print question marks in their place."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


@contextmanager
def _loudness(verbose: int, *, quiet: bool) -> Iterator[None]:
    """What goes to standard error beside errors: warnings, with ``verbose`` more, or nothing."""
    own, handler = logging.getLogger("cubestack"), logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    before = own.level
    hush(quiet)
    own.setLevel(logging.ERROR if quiet else LEVELS[min(verbose, len(LEVELS) - 1)])
    own.addHandler(handler)
    try:
        yield
    finally:
        own.removeHandler(handler)
        own.setLevel(before)
        hush(False)


def main(
    arguments: Sequence[str] | None = None, on_start: Callable[[], object] = lambda: None
) -> int:
    """Run the command line ``arguments`` (default: the process's own); returns the exit status.

    ``on_start`` is called when KeyboardInterrupt is handled.
    """
    if arguments is None:
        _end_in_order()
        _write_anywhere()
        gc.disable()
    given = sys.argv[1:] if arguments is None else arguments
    asked = next((word for word in given if not word.startswith("-")), None)
    args = make_parser(asked or "").parse_args(given)
    if arguments is None:
        gc.freeze()  # what was loaded stays: the collector need not look at it, now or later
        gc.enable()
    try:
        on_start()
        with _loudness(args.verbose, quiet=args.quiet), warnings.catch_warnings():
            warnings.showwarning = lambda text, *_, **__: say(f"cubestack {args.command}: {text}")
            return int(args.run(args) or DONE)
    except KeyboardInterrupt:
        return SIGNALLED + signal.SIGINT
    except BrokenPipeError:
        return FAILED
    except ValueError as error:  # all bad input is a ValueError with a full sentence
        return _fail(args.command, str(error), WRONG_CALL)
    except OSError as error:
        named = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
        return _fail(args.command, named or str(error))
    except MemoryError:
        return _fail(args.command, "there is not enough memory for this")
    except RuntimeError as error:
        from cubestack.emulator.native.compiler import CompilerError

        if not isinstance(error, CompilerError):
            raise
        print(f"cubestack {args.command}: {shown_lines(str(error))}", file=sys.stderr)
        return FAILED


def _fail(command: str, text: str, status: int = FAILED) -> int:
    """Print an error as one line, whatever names are in it; returns the exit status."""
    print(f"cubestack {command}: {one_line(text)}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
