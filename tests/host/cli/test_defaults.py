import argparse
import re
from collections.abc import Iterator

import pytest

from cubestack.host.cli.main import make_parser

TOLD = re.compile(r"\(?default:? \(?(-?[\d.]+(?:,-?[\d.]+)*)(?![\w.]*[a-z])")


def actions(
    parser: argparse.ArgumentParser, words: str = ""
) -> Iterator[tuple[str, argparse.Action]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                yield from actions(sub, f"{words} {name}".strip())
        else:
            yield f"{words} {'/'.join(action.option_strings) or action.dest}", action


ALL = list(actions(make_parser()))
NUMBERS = [
    (name, action, found[1])
    for name, action in ALL
    if (found := TOLD.search(action.help or "")) and isinstance(action.default, int | float | tuple)
]


def test_numbers_are_found_in_the_help() -> None:
    assert len(NUMBERS) > 30


@pytest.mark.parametrize(("name", "action", "told"), NUMBERS, ids=[one[0] for one in NUMBERS])
def test_default_in_the_help_is_the_default(name: str, action: argparse.Action, told: str) -> None:
    values = action.default if isinstance(action.default, tuple) else (action.default,)
    assert [float(value) for value in told.rstrip(".").split(",")] == pytest.approx(
        list(values), rel=1e-4
    )


def test_flags_default_to_false() -> None:
    for name, action in ALL:
        if isinstance(action, argparse._StoreTrueAction):
            assert action.default is False, name
