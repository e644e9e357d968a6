"""The command line's arguments: values that are checked, and options made from declarations."""

import argparse
from collections import defaultdict
from collections.abc import Callable
from dataclasses import Field
from importlib.metadata import metadata
from typing import Any, NoReturn, TypeVar

from cubestack.host import options
from cubestack.host.options import Kind, Option, Options, flag

T = TypeVar("T")
OptionsT = TypeVar("OptionsT", bound=Options)


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Puts a heading above the first command of each group."""

    def _format_action(self, action: argparse.Action) -> str:
        heading = getattr(action, "heading", "")
        return (f"\n  {heading}:\n" if heading else "") + super()._format_action(action)


class Parser(argparse.ArgumentParser):
    """A parser that prints its help as written, and errors in one line."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=_Formatter, **options)

    def format_help(self) -> str:
        """The help, with the address of the documents if it names one: they aren't installed."""
        text = super().format_help()
        return f"{text}\ndocs/: {_documents()}\n" if "docs/" in text else text

    def error(self, message: str) -> NoReturn:
        """End with exit status 2."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def _documents() -> str:
    """Where the documents are, as the distribution says it."""
    links: list[str] = metadata("cubestack").get_all("Project-URL") or []
    return next(one.removeprefix("Documentation, ") for one in links if one.startswith("Doc"))


def add_failed(commands: "argparse._SubParsersAction[Any]", name: str, error: str) -> None:
    """Declare a command that ends with this error, whatever its options."""
    command = commands.add_parser(name, help="does not load")
    failed: Any = lambda *_: command.exit(2, f"{command.prog}: {error}\n")  # noqa: E731
    command.parse_known_args = failed


def typed(kind: Kind[T]) -> Callable[[str], T]:
    """The type of an argument of this kind; its error says what would be right."""

    def read(text: str) -> T:
        try:
            return kind(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """Type of a whole number in ``least``..``most``."""
    return typed(options.whole(least, most))


def add_options(parser: argparse.ArgumentParser, *declared: type[Options]) -> None:
    """Declare the options of these classes; one that several have is as the first has it."""
    groups = defaultdict[str, argparse._ActionsContainer](parser.add_mutually_exclusive_group)
    fields: dict[str, Field[Any]] = {}
    for each in declared:
        fields |= {name: field for name, field in each.declared().items() if name not in fields}
    for name, field in fields.items():
        option: Option = field.metadata["option"]
        place = parser if option.group is None else groups[option.group]
        how: dict[str, Any] = {"default": field.default, "help": option.help}
        if option.kind is None and not option.choices:
            place.add_argument(flag(name), action="store_true", **how)
            continue
        how["type"] = None if option.kind is None else typed(option.kind)
        how |= {"choices": option.choices or None, "metavar": option.metavar}
        if option.many:
            how |= {"action": "append", "default": []}
        place.add_argument(flag(name), **how)


def chosen(args: argparse.Namespace, declared: type[OptionsT]) -> OptionsT:
    """The options of ``declared`` as they were given; ValueError where they do not go together."""
    return declared(**{name: getattr(args, name) for name in declared.declared()})
