"""Names of a user's design: files of Verilog and their top module, or an Amaranth class."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from cubestack.firmware_model.formats.untrusted import read_text
from cubestack.firmware_model.versions import GATEWARE

#: Suffixes of files with Verilog and with SystemVerilog.
VERILOG, SYSTEM_VERILOG = (".v",), (".sv",)

LIST = ".f"
"""Suffix of a list of files."""

_FILE = re.compile(r"\.(?:v|sv|vh|svh|f|vhd|vhdl)$", re.IGNORECASE)
_CLASS = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")
_TOP = re.compile(r"(.+?):([A-Za-z_$][\w$]*)")
_COMMENT = re.compile(r"(?://|#).*")


VERSION = "cubestack_version"
"""Attribute of a top module or class: the version of the board's pins that it is written for."""


class GatewareError(ValueError):
    """A user's design can not be used; one line for each reason."""


def check_version(name: str, found: object) -> None:
    """Raise GatewareError for a design ``name`` of another version; None is the first."""
    try:
        GATEWARE.check(found)
    except ValueError as error:
        raise GatewareError(f"{name}: {error}") from None


@dataclass(frozen=True)
class Source:
    """Files of a design in Verilog, in their order."""

    name: str  #: for messages
    files: tuple[Path, ...]
    top: str | None = None  #: module; None for the only one that no other instantiates
    includes: tuple[Path, ...] = ()  #: folders of included files
    defines: tuple[str, ...] = ()  #: macros: NAME or NAME=VALUE

    @property
    def folders(self) -> tuple[Path, ...]:
        """Where files that the design names may lie, the first ones first."""
        return tuple(dict.fromkeys((*self.includes, *(file.parent for file in self.files))))


@dataclass(frozen=True)
class ClassName:
    """An Amaranth class."""

    module: str
    name: str


@dataclass
class _Found:
    files: list[Path] = field(default_factory=list)
    includes: list[Path] = field(default_factory=list)
    defines: list[str] = field(default_factory=list)


def parse_source(text: str, folder: Path | None = None) -> Source | ClassName:
    """The design that ``text`` names; relative paths start at ``folder``, by default the current.

    ``text`` is FILE[:TOP], FILE,FILE...[:TOP], FOLDER[:TOP], LIST.f[:TOP], or MODULE:CLASS.
    Raises GatewareError if there is no such file.
    """
    base = Path() if folder is None else folder
    top: str | None = None
    names = text
    if not (base / text).exists() and (match := _TOP.fullmatch(text)):
        names, top = match.groups()
    is_path = (base / names).exists() or "," in names or "/" in names or _FILE.search(names)
    if not is_path:
        if _CLASS.fullmatch(text):
            module, _, name = text.partition(":")
            return ClassName(module, name)
        raise GatewareError(
            f"no gateware {text!r}: it takes a Verilog file (design.v, design.sv:top), a folder, "
            "a list of files (files.f), or an Amaranth class (module:Class)"
        )
    found = _Found()
    for name in names.split(","):
        _add(found, base / name, name)
    if not found.files:
        raise GatewareError(f"{names} has no Verilog file (*.v, *.sv)")
    files = tuple(dict.fromkeys(found.files))
    includes = tuple(dict.fromkeys(found.includes))
    return Source(Path(names).name or names, files, top, includes, tuple(found.defines))


def rebased(text: str, folder: Path) -> str:
    """``text`` with the paths that exist below ``folder`` starting there.

    ``text`` as above, or "sun=DESIGN,nadir=DESIGN"; a class stays as it is.
    """
    parts = []
    for part in text.split(","):
        before, equals, name = part.rpartition("=")
        top = _TOP.fullmatch(name)
        exists = (folder / name).exists() or (top and (folder / top[1]).exists())
        parts.append(f"{before}{equals}{folder / name if name and exists else name}")
    return ",".join(parts)


def _add(found: _Found, path: Path, name: str) -> None:
    if not path.exists():
        raise GatewareError(f"gateware {name} does not exist")
    if path.is_fifo():
        raise GatewareError(f"gateware {name} is a pipe; give a file")
    suffix = path.suffix.lower()
    if path.is_dir():
        found.includes.append(path)
        suffixes = VERILOG + SYSTEM_VERILOG
        found.files += sorted(file for file in path.iterdir() if file.suffix.lower() in suffixes)
    elif suffix == LIST:
        _add_list(found, path, name)
    elif suffix in (".vhd", ".vhdl"):
        raise GatewareError(f"gateware {name} is VHDL; convert it to Verilog (ghdl --synth) first")
    else:
        found.files.append(path)


def _add_list(found: _Found, path: Path, name: str) -> None:
    """Add what a list names: paths from its folder, +incdir+FOLDER, +define+NAME=VALUE."""
    for line, words in _words(read_text(path, error=GatewareError).splitlines()):
        for word in words:
            if word.startswith("+incdir+"):
                found.includes += [path.parent / part for part in word.split("+")[2:] if part]
            elif word.startswith("+define+"):
                found.defines += [part for part in word.split("+")[2:] if part]
            elif word[0] in "+-":
                known = "files, +incdir+FOLDER and +define+NAME=VALUE"
                raise GatewareError(f"{name}:{line}: {word}: a list has {known}")
            else:
                _add(found, path.parent / word, f"{word} ({name}:{line})")


def _words(lines: Iterable[str]) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(lines, 1):
        yield number, _COMMENT.sub("", line).split()
