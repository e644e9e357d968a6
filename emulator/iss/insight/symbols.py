"""Symbols of a program from ELF and DWARF: functions, variables, source lines.

A stripped program, or one that is not an ELF file, has none; everything works without them.
"""

import logging
import os
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from io import BytesIO
from itertools import islice
from typing import Any, TypeVar

from elftools.dwarf.callframe import FDE
from elftools.elf.constants import SH_FLAGS
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

from cubestack.emulator.iss.image import Image
from cubestack.firmware_model.formats.untrusted import shown


@dataclass(frozen=True)
class Symbol:
    """A function, or an object in memory."""

    name: str
    address: int
    size: int

    @property
    def end(self) -> int:
        return self.address + self.size


@dataclass(frozen=True)
class Line:
    """A line of a source file and its code, ``address`` to ``end`` - 1."""

    address: int
    end: int
    file: str
    number: int
    statement: bool


_Range = TypeVar("_Range", Symbol, Line)
_T = TypeVar("_T")

MOST_ENTRIES = 1_000_000
"""Of one table; further ones are not read."""

_log = logging.getLogger(__name__)


class Symbols:
    """The symbols of one program.

    Attributes:
        functions: sorted by address, without overlap.
        variables: by name.
        labels: address or value of every symbol by name, including those of the linker script.
    """

    def __init__(self, elf: bytes | None) -> None:
        """Read the contents of an ELF file; None: no symbols."""
        self._elf = elf
        self._functions: dict[int, Symbol] = {}
        self.variables: dict[str, Symbol] = {}
        self.labels: dict[str, int] = {}
        if elf is not None:
            _intact(self._read_symbols(), "symbol table")
        by_address = sorted(self._functions.values(), key=lambda one: one.address)
        self.functions = list(_apart(by_address))
        self._starts = [function.address for function in self.functions]

    @staticmethod
    @lru_cache(maxsize=4)
    def of(image: Image | None) -> "Symbols":
        """Symbols of a program, cached."""
        return Symbols(None if image is None else image.elf)

    def function_at(self, address: int) -> Symbol | None:
        """The function with code at ``address``."""
        return _containing(self.functions, self._starts, address)

    def line_at(self, address: int) -> Line | None:
        """The source line of the code at ``address``."""
        return _containing(self.lines, self._line_starts, address)

    def function(self, name: str) -> Symbol | None:
        return next((found for found in self.functions if found.name == name), None)

    def describe(self, address: int, place: int | None = None) -> str:
        """An address with function and offset, file and line if known.

        ``place``: the address to look up instead. The return address of a call at the end of a
        function lies behind that function.
        """
        place = address if place is None else place
        function, line = self.function_at(place), self.line_at(place)
        words = [f"{address:08x}"]
        if function is not None:
            offset = address - function.address
            words.append(function.name + (f"+{offset:#x}" if offset else ""))
        if line is not None:
            words.append(f"({os.path.basename(line.file)}:{line.number})")
        return " ".join(words)

    @cached_property
    def lines(self) -> list[Line]:
        """The line table by address."""
        return [line for line in self.rows if line.end > line.address]

    @cached_property
    def rows(self) -> list[Line]:
        """The line table including statements without code of their own."""
        return sorted(_intact(self._read_lines(), "line table"), key=lambda line: line.address)

    @cached_property
    def _line_starts(self) -> list[int]:
        return [line.address for line in self.lines]

    @cached_property
    def frames(self) -> "list[tuple[int, int, Any]]":
        """Start, end and record of the call frame information (DWARF 4, 6.4), by start."""
        return sorted(_intact(self._read_frames(), "frame table"), key=lambda one: one[0])

    def _read_frames(self) -> "Iterator[tuple[int, int, Any]]":
        dwarf = ELFFile(BytesIO(self._elf or b"")).get_dwarf_info()
        for entry in dwarf.CFI_entries() if dwarf.has_CFI() else ():
            if isinstance(entry, FDE) and self.function_at(start := entry["initial_location"]):
                entry.get_decoded()  # damage shows here, not in the middle of a run
                yield start, start + entry["address_range"], entry

    def _read_symbols(self) -> Iterator[None]:
        assert self._elf is not None
        file = ELFFile(BytesIO(self._elf))
        found = self._functions
        for section in file.iter_sections():
            if not isinstance(section, SymbolTableSection):
                continue
            for symbol in section.iter_symbols():
                name, kind, where = symbol.name, symbol["st_info"]["type"], symbol["st_shndx"]
                if not name or where == "SHN_UNDEF" or name.startswith(("$t", "$d", "$a")):
                    continue
                value, size = symbol["st_value"], symbol["st_size"]
                if kind == "STT_FUNC":
                    value &= ~1
                    known = found.get(value)
                    if known is None or known.size < size:
                        found[value] = Symbol(name, value, size)
                elif kind == "STT_OBJECT":
                    self.variables[name] = Symbol(name, value, size)
                self.labels[name] = value
                yield

    def _read_lines(self) -> Iterator[Line]:
        if self._elf is None:
            return
        file = ELFFile(BytesIO(self._elf))
        if not file.has_dwarf_info():
            return
        dwarf, code = file.get_dwarf_info(), _code(file)
        for unit in dwarf.iter_CUs():
            program = dwarf.line_program_for_CU(unit)
            if program is None:
                continue
            top = unit.get_top_DIE().attributes
            folder = top["DW_AT_comp_dir"].value.decode() if "DW_AT_comp_dir" in top else ""
            names = _file_names(program, folder)
            before: Any = None
            linked = False
            for entry in program.get_entries():
                state = entry.state
                if state is None:
                    continue
                if before is None:
                    start = state.address  # 0 of code that the linker discarded
                    linked = self.function_at(start) is not None or (
                        start > 0 and any(start in section for section in code)
                    )  # the latter of a weak function that another one replaces
                elif linked:
                    file_name, statement = names.get(before.file, "?"), bool(before.is_stmt)
                    yield Line(before.address, state.address, file_name, before.line, statement)
                before = None if state.end_sequence else state


def _intact(entries: Iterator[_T], what: str) -> list[_T]:
    """The entries before damaged data, of which a warning tells."""
    found: list[_T] = []
    try:
        found.extend(islice(entries, MOST_ENTRIES))
    except Exception as error:  # elftools raises various exceptions for damaged files
        reason = shown(str(error)) or type(error).__name__
        _log.warning("the firmware's %s is damaged: %s", what, reason)
    return found


def _containing(items: list[_Range], starts: list[int], address: int) -> _Range | None:
    """The item that contains the address, of items sorted by their starts."""
    index = bisect_right(starts, address) - 1
    return items[index] if index >= 0 and address < items[index].end else None


def _code(file: ELFFile) -> list[range]:
    """Addresses of the sections with instructions."""
    sections = (one for one in file.iter_sections() if one["sh_flags"] & SH_FLAGS.SHF_EXECINSTR)
    return [range(one["sh_addr"], one["sh_addr"] + one["sh_size"]) for one in sections]


def _apart(functions: list[Symbol]) -> Iterator[Symbol]:
    """Functions by address, each cut at the next one; one without a size ends there."""
    for index, function in enumerate(functions):
        follower = functions[index + 1].address if index + 1 < len(functions) else None
        size = function.size or 2
        if follower is not None and (not function.size or function.end > follower):
            size = min(size if function.size else 1 << 12, follower - function.address)
        yield Symbol(function.name, function.address, size)


def _file_names(program: Any, folder: str) -> dict[int, str]:
    """Paths by their numbers in a line program."""
    header = program.header
    folders = [
        name.decode() if isinstance(name, bytes) else name for name in header["include_directory"]
    ]
    first = 0 if header["version"] >= 5 else 1
    names = {}
    for number, entry in enumerate(header["file_entry"], start=first):
        index = entry["dir_index"] - first
        where = folders[index] if 0 <= index < len(folders) else ""
        names[number] = os.path.normpath(os.path.join(folder, where, entry["name"].decode()))
    return names
