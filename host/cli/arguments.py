"""The command line's arguments: values that are checked, and options made from declarations."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, NoReturn, TypeVar

from cubestack.host import options
from cubestack.host.options import Kind, Options, flag

T = TypeVar("T")
OptionsT = TypeVar("OptionsT", bound=Options)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """End with exit code 2."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


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
    groups: dict[str, argparse._MutuallyExclusiveGroup] = {}
    names: set[str] = set()
    for name, field in ((n, f) for each in declared for n, f in each.declared().items()):
        if name in names:
            continue
        names.add(name)
        option = field.metadata["option"]
        place: argparse._ActionsContainer = parser
        if option.group is not None:
            if option.group not in groups:
                groups[option.group] = parser.add_mutually_exclusive_group()
            place = groups[option.group]
        how: dict[str, Any] = {"default": field.default, "help": option.help}
        if option.kind is None and not option.choices:
            place.add_argument(flag(name), action="store_true", **how)
            continue
        if option.kind is not None:
            how["type"] = typed(option.kind)
        if option.choices:
            how["choices"] = option.choices
        if option.metavar is not None:
            how["metavar"] = option.metavar
        if option.many:
            how |= {"action": "append", "default": []}
        place.add_argument(flag(name), **how)


def chosen(args: argparse.Namespace, declared: type[OptionsT]) -> OptionsT:
    """The options of ``declared`` as they were given; ValueError where they do not go together."""
    return declared(**{name: getattr(args, name) for name in declared.declared()})
