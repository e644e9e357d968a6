"""Hooks of mkdocs that generate two pages: all commands, and all public names of `cubestack`.

Links that lead out of the documents lead to the repository.
"""

import inspect
import re
from argparse import _SubParsersAction
from collections.abc import Iterator
from typing import Any

from mkdocs.structure.files import File, Files

import cubestack
from cubestack.host.cli.main import make_parser

REPOSITORY = "https://github.com/cubestack/cubestack/blob/main/"


def on_files(files: Files, config: Any) -> Files:
    """Add the pages."""
    pages = {"reference-commands.md": commands(), "reference-python.md": python()}
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links that lead out of the documents."""
    return re.sub(r"\]\(\.\./([^)]+)\)", rf"]({REPOSITORY}\1)", markdown)


def commands() -> str:
    """What ``--help`` says of each command."""
    parser = make_parser()
    return "\n".join(["# Commands\n", _help(parser), *_commands_of(parser, "##", "cubestack")])


def _commands_of(parser: Any, heading: str, words: str) -> Iterator[str]:
    """Headings and help of a parser's commands, and of theirs."""
    for groups in (one for one in parser._actions if isinstance(one, _SubParsersAction)):
        for name, command in groups.choices.items():
            yield f"\n{heading} {words} {name}\n"
            yield _help(command)
            yield from _commands_of(command, heading + "#", f"{words} {name}")


def python() -> str:
    """What ``import cubestack`` gives, with its docstrings."""
    about = str(inspect.getdoc(cubestack)).replace("::\n\n", "")
    parts = ["# Python\n", f"```text\n{about}\n```\n"]
    for name in sorted(name for name in cubestack.__all__ if not name.startswith("_")):
        found = getattr(cubestack, name)
        parts.append(f"\n## {name}\n\n{_described(name, found)}")
        if inspect.isclass(found):
            parts += _members(found)
    return "\n".join(parts)


def _members(owner: type) -> list[str]:
    own = [(name, one) for name, one in vars(owner).items() if not name.startswith("_")]
    documented = [(name, one) for name, one in own if callable(one) or isinstance(one, property)]
    return [
        f"\n### {owner.__name__}.{name}\n\n{_described(name, one)}"
        for name, one in documented
        if inspect.getdoc(one)
    ]


def _described(name: str, found: Any) -> str:
    """How it is called, with types by their own names, and what it says of itself."""
    try:
        given = "" if isinstance(found, property) else str(inspect.signature(found))
    except (TypeError, ValueError):
        given = ""
    text = inspect.getdoc(found) if callable(found) or given == "" else repr(found)
    return f"```text\n{name}{re.sub(r'(?:[A-Za-z_]+[.])+(?=[A-Za-z])', '', given)}\n\n{text}\n```\n"


def _help(parser: Any) -> str:
    return f"```text\n{parser.format_help()}```\n"
