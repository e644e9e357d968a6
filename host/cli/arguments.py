"""The command line's arguments: values that are checked, and options made from declarations."""

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from importlib.metadata import metadata
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from cubestack.firmware_model.formats.untrusted import shown
from cubestack.firmware_model.values import FLAG, Declaration, ListDeclaration
from cubestack.host.errors import TargetError
from cubestack.host.options import OUTPUT, Options, option_string

FORCE = "--force"

OptionsT = TypeVar("OptionsT", bound=Options)


MISSING = "the following arguments are required"
"""How argparse's error begins."""

MOST_LISTED = 12
"""Choices that an error lists."""

LONGEST_ERROR = 1000


def one_line(text: str) -> str:
    """A text as one line of bounded length, whatever names are in it."""
    line = shown(text)
    return line if len(line) <= LONGEST_ERROR else f"{line[:LONGEST_ERROR]}…"


def suggestion(word: str, known: Iterable[str]) -> str:
    """The end of an error about a misspelt word; empty if no known one is like it."""
    close = get_close_matches(word, list(known), 1)
    return f"; did you mean {close[0]}?" if close else ""


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Puts a heading above the first command of each group."""

    def _format_action(self, action: argparse.Action) -> str:
        heading = getattr(action, "heading", "")
        return (f"\n  {heading}:\n" if heading else "") + super()._format_action(action)


class Parser(argparse.ArgumentParser):
    """A parser that prints its help as written, and errors in one line.

    ``declare`` adds its arguments when they are first needed, as that may load much code.
    TargetError of it ends the command, whatever its options.
    """

    def __init__(self, declare: Callable[["Parser"], object] | None = None, **options: Any) -> None:
        super().__init__(formatter_class=_Formatter, **options)
        self.set_defaults(own_parser=self)
        self._declare = declare
        self._given: list[str] = []
        self.failed = ""

    def declared(self) -> None:
        """Add the arguments that have not been added."""
        declare, self._declare = self._declare, None
        if declare is not None:
            try:
                declare(self)
            except TargetError as error:
                self.failed = str(error)

    def needed(self, names: Iterable[str]) -> list[str]:
        """Those of ``names`` that the call contains; all if it contains none."""
        known = list(names)
        return [name for name in known if name in self._given] or known

    def all_declared(self) -> "Parser":
        """This parser with all arguments of all its commands."""
        self.declared()
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                for command in action.choices.values():
                    command.all_declared()
        return self

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """The arguments; unknown ones are an error of the command that they belong to.

        ``others``, a default of that command, returns flags of other devices with these devices'
        names.
        """
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            command, flag = parsed.own_parser, unknown[0].partition("=")[0]
            if owners := getattr(parsed, "others", dict)().get(flag):
                command.error(f"{flag} is an option of {', '.join(owners)}, not of this device")
            command.unknown(unknown)
        parsed.own_parser._check_outputs(parsed)
        return parsed

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse's; keeps the words for an error."""
        self._given = list(args or ())
        self.declared()
        if self.failed:
            self.exit(2, f"{self.prog}: {self.failed}\n")
        return super().parse_known_args(args, namespace)

    def unknown(self, words: Sequence[str]) -> NoReturn:
        """Exit: this command does not know these words."""
        known = [flag for action in self._actions for flag in action.option_strings]
        hint = suggestion(words[0].partition("=")[0], known)
        self.error(f"unknown argument {' '.join(words)}{hint}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Raise the error of a value that is no choice: the nearest one, or all if they are few."""
        choices = None if action.choices is None else [str(one) for one in action.choices]
        if choices is None or value in (action.choices or ()):
            return
        hint = suggestion(str(value), choices)
        if isinstance(action, argparse._SubParsersAction):
            what = f"no {str(action.metavar).lower()} {value!r}"
            if hint:
                near = action.choices[get_close_matches(str(value), choices, 1)[0]]
                self.exit(2, f"{self.prog}: {one_line(what)}{hint}; see {near.prog} --help\n")
            few = f"; there are {', '.join(choices)}" if len(choices) <= MOST_LISTED else ""
            self.error(f"{what}{few}")
        if not action.option_strings:
            self._check_flags()  # it may be the value of a misspelt one
        few = f"one of {', '.join(choices)}, " if len(choices) <= MOST_LISTED or not hint else ""
        raise argparse.ArgumentError(action, f"must be {few}not {value!r}{hint}")

    def _check_outputs(self, parsed: argparse.Namespace) -> None:
        """Refuse to replace a file without ``--force``."""
        for action in self._actions:
            path, inside = getattr(parsed, action.dest, None), getattr(action, "inside", None)
            if path is None or inside is None or parsed.force:
                continue
            place = path / inside
            option = action.option_strings[0]
            try:
                exists = place.is_file()
            except OSError as error:  # such as a name that is too long
                self.error(f"{option}: can not write {place}: {error.strerror}")
            if exists and not action.renews(place):  # type: ignore[attr-defined]
                self.error(f"{option}: {place} exists; choose another, or replace it with {FORCE}")

    def format_help(self) -> str:
        """The help, with the address of the documents if it names one: they aren't installed."""
        text = super().format_help()
        return f"{text}\ndocs/: {_documents()}\n" if "docs/" in text else text

    def error(self, message: str) -> NoReturn:
        if message.startswith(MISSING):
            self._check_flags()
        self.exit(2, f"{self.prog}: {one_line(message)}; see {self.prog} --help\n")

    def _check_flags(self) -> None:
        """Exit if a flag is unknown: what seems to be missing may be its value."""
        words = [word for word in self._given if word.startswith("--") and word != "--"]
        for word in words:
            flag = word.partition("=")[0]
            if flag not in self._option_string_actions and not self._get_option_tuples(flag):
                self._given = []
                self.unknown([word])


def _documents() -> str:
    """Where the documents are, by the distribution's repository."""
    return metadata("cubestack")["Project-URL"].rpartition(" ")[2] + "/tree/main/docs"


def add_value(parser: argparse._ActionsContainer, name: str, one: Any, **how: Any) -> None:
    """Declare a value as an option; ``how`` is given to the parser besides."""
    repeated = isinstance(one, ListDeclaration) and one.count is None
    part = one.part if repeated else one
    how = {"dest": name, "default": one.default, "help": one.meaning, **how}
    if part.kind.name == FLAG.name:
        how |= {"action": "store_const", "const": True}
    else:
        metavar = one.metavar or "|".join(part.choices) or part.unit.upper().replace("/", "_")
        how |= {"type": _read(part), "choices": part.choices or None, "metavar": metavar or None}
        if repeated:
            how |= {"action": "append", "default": []}
    action = parser.add_argument(option_string(name), **how)
    if part.kind.name == OUTPUT.name:
        _declare_output(parser, action)


def add_flag(parser: argparse._ActionsContainer, name: str, meaning: str) -> None:
    parser.add_argument(name, action="store_true", help=meaning)


def add_path(
    parser: argparse._ActionsContainer, name: str, meaning: str, metavar: str = "FILE"
) -> None:
    parser.add_argument(name, type=Path, metavar=metavar, help=meaning)


def add_output(
    parser: argparse._ActionsContainer,
    name: str,
    meaning: str,
    metavar: str = "FILE",
    *,
    inside: str = "",
    required: bool = False,
    renews: Callable[[Path], bool] = lambda _path: False,
) -> None:
    """Declare an option that names a file to write, and ``--force`` to replace one that exists.

    Args:
        parser, name, meaning, metavar, required: of the option.
        inside: the option names a folder, in which this file is written.
        renews: whether a file is an earlier output of the same command, which can be made again
            and is replaced without ``--force``.
    """
    action = parser.add_argument(name, type=Path, metavar=metavar, help=meaning, required=required)
    _declare_output(parser, action, inside, renews)


def _declare_output(
    parser: argparse._ActionsContainer,
    action: argparse.Action,
    inside: str = "",
    renews: Callable[[Path], bool] = lambda _path: False,
) -> None:
    action.inside, action.renews = inside, renews  # type: ignore[attr-defined]
    whole = getattr(parser, "_container", parser)
    if FORCE not in whole._option_string_actions:
        add_flag(whole, FORCE, "replace files that exist")


def _read(one: Declaration) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        try:
            return one.parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def add_options(parser: argparse.ArgumentParser, *declared: type[Options]) -> None:
    """Declare the options of these classes; one that several have is as the first has it."""
    groups = defaultdict[str, argparse._ActionsContainer](parser.add_mutually_exclusive_group)
    own: dict[str, Declaration] = {}
    for each in declared:
        own = {**each.declared(), **own}
    for name, one in own.items():
        add_value(groups[one.group] if one.group else parser, name, one)


def chosen(args: argparse.Namespace, declared: type[OptionsT]) -> OptionsT:
    """The options of ``declared`` as they were given; ValueError where they do not go together."""
    return declared(**{name: getattr(args, name) for name in declared.declared()})
