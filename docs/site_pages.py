"""Hooks of mkdocs that generate pages: commands, public names of `cubestack`, `cubestack.sensor`.

Links that lead out of the documents lead to the repository.
"""

import inspect
import re
from argparse import _SubParsersAction
from collections.abc import Iterator
from functools import partial
from importlib.metadata import metadata
from typing import Any

from mkdocs.structure.files import File, Files

import cubestack
import cubestack.sensor
from cubestack.firmware_model.mcu.costs import CostTable
from cubestack.hdl import blocks
from cubestack.host.cli.main import make_parser
from cubestack.host.cli.new_sensor import rendered

REPOSITORY = metadata("cubestack")["Project-URL"].rpartition(" ")[2] + "/blob/main/"


def on_files(files: Files, config: Any) -> Files:
    """Add the pages."""
    pages = {
        "reference/commands.md": commands(),
        "reference/python.md": python(),
        "reference/sensor.md": sensor(),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links that lead out of the documents."""
    up = re.escape("../" * (page.file.src_uri.count("/") + 1))
    return re.sub(rf"\]\({up}([^)]+)\)", rf"]({REPOSITORY}\1)", markdown)


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


def sensor() -> str:
    """What sensors of other distributions import, and the files of a new one."""
    parts = [f"# Python for sensors\n\n```text\n{inspect.getdoc(cubestack.sensor)}\n```\n"]
    for topic, names in cubestack.sensor.TOPICS.items():
        parts.append(f"\n## {topic}\n")
        for name in names:
            found = getattr(cubestack.sensor, name)
            parts.append(f"\n### {name}\n\n{_described(name, found)}")
            parts += _members(found, "####") if inspect.isclass(found) else []
    parts.append("\n## Blocks of `cubestack.hdl.blocks`\n")
    for name in blocks.__all__:
        parts.append(f"\n### {name}\n\n{_described(name, getattr(blocks, name))}")
    parts.append("\n## Files of `cubestack new-sensor glow`\n")
    for path, text in rendered("glow"):
        language = "toml" if path.endswith(".toml") else "python"
        parts.append(f"\n`{path}`\n\n```{language}\n{text}```\n")
    return "\n".join(parts)


def _members(owner: type, heading: str = "###") -> list[str]:
    own = [(name, one) for name, one in vars(owner).items() if not name.startswith("_")]
    documented = [(name, one) for name, one in own if callable(one) or isinstance(one, property)]
    return [
        f"\n{heading} {owner.__name__}.{name}\n\n{_described(name, one)}"
        for name, one in documented
        if inspect.getdoc(one)
    ]


def _described(name: str, found: Any) -> str:
    """How it is called, with types by their own names, and its docstring."""
    try:
        given = "" if isinstance(found, property) else str(inspect.signature(found))
    except (TypeError, ValueError):
        given = ""
    return f"```text\n{name}{_plain(given)}\n\n{_text(found)}\n```\n"


def _text(found: Any) -> str:
    if isinstance(found, CostTable):
        cycles = ", ".join(f"{name} {cycles}" for name, cycles in found.cycles.items())
        return f"{found.name} at {found.clock_hz / 1e6:g} MHz; cycles: {cycles}"
    if isinstance(found, partial):
        kind = found.keywords["type"] if "type" in found.keywords else found.args[0].name
        return f"A `{found.func.__name__.replace('_declare', 'Declaration')}` of type {kind}."
    if inspect.isclass(found) or inspect.isroutine(found) or isinstance(found, property):
        return str(inspect.getdoc(found))
    return _plain(repr(found))


def _plain(text: str) -> str:
    """``text`` without the modules of names, and without the addresses of functions."""
    text = re.sub(r"<function .*? at 0x\w+>", "...", text)
    return re.sub(r"(?:[A-Za-z_]+[.])+(?=[A-Za-z])", "", text)


def _help(parser: Any) -> str:
    return f"```text\n{parser.format_help()}```\n"
