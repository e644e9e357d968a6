"""Names of a program: functions, variables and source lines by address, from ELF and DWARF.

A stripped program, or one that is no ELF file, has no names; everything works without them.
"""

import os
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from io import BytesIO
from typing import Any

from cubestack.emulator.iss.image import Image


@dataclass(frozen=True)
class Function:
    """A function, or a piece of code with a name."""

    name: str
    address: int
    size: int

    @property
    def end(self) -> int:
        """The address behind it."""
        return self.address + self.size


@dataclass(frozen=True)
class Variable:
    """Data with a name."""

    name: str
    address: int
    size: int


@dataclass(frozen=True)
class Line:
    """Code from ``address`` up to ``end`` - 1 that belongs to a line of a source file."""

    address: int
    end: int
    file: str
    number: int
    statement: bool


class Symbols:
    """What the file of a program says of its addresses.

    Attributes:
        functions: by address; none overlaps another.
        variables: by name.
        labels: value of every symbol by name, those of the linker script among them.
    """

    def __init__(self, elf: bytes | None) -> None:
        """Read an ELF file; None is a program without names."""
        self._elf = elf
        self.functions: list[Function] = []
        self.variables: dict[str, Variable] = {}
        self.labels: dict[str, int] = {}
        if elf is not None:
            self._read_symbols()
        self._starts = [function.address for function in self.functions]

    @staticmethod
    @lru_cache(maxsize=4)
    def of(image: Image | None) -> "Symbols":
        """Those of a program, read once; none for none."""
        return Symbols(None if image is None else image.elf)

    def function_at(self, address: int) -> Function | None:
        """The function that has code at ``address``."""
        index = bisect_right(self._starts, address) - 1
        if index < 0 or address >= self.functions[index].end:
            return None
        return self.functions[index]

    def line_at(self, address: int) -> Line | None:
        """The source line of the code at ``address``."""
        index = bisect_right(self._line_starts, address) - 1
        if index < 0 or address >= self.lines[index].end:
            return None
        return self.lines[index]

    def function(self, name: str) -> Function | None:
        """The function ``name``."""
        return next((found for found in self.functions if found.name == name), None)

    def describe(self, address: int, place: int | None = None) -> str:
        """An address for a reader: function and offset, file and line where they are known.

        These are of ``place``, if given: what calls last of all returns behind its end.
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
        """The line table by address, of what was linked."""
        return [line for line in self.rows if line.end > line.address]

    @cached_property
    def rows(self) -> list[Line]:
        """Likewise with rows of no length: a statement of which no code is left of its own."""
        return sorted(self._read_lines(), key=lambda line: line.address)

    @cached_property
    def _line_starts(self) -> list[int]:
        return [line.address for line in self.lines]

    @cached_property
    def frames(self) -> "list[tuple[int, int, Any]]":
        """Start, end and record of the call frame information (DWARF 4, 6.4), by start."""
        from elftools.dwarf.callframe import FDE
        from elftools.elf.elffile import ELFFile

        if self._elf is None:
            return []
        dwarf = ELFFile(BytesIO(self._elf)).get_dwarf_info()
        if not dwarf.has_CFI():
            return []
        found = [
            (entry["initial_location"], entry["initial_location"] + entry["address_range"], entry)
            for entry in dwarf.CFI_entries()
            if isinstance(entry, FDE) and self.function_at(entry["initial_location"])
        ]
        return sorted(found, key=lambda one: one[0])

    def _read_symbols(self) -> None:
        from elftools.elf.elffile import ELFFile
        from elftools.elf.sections import SymbolTableSection

        assert self._elf is not None
        file = ELFFile(BytesIO(self._elf))
        found: dict[int, Function] = {}
        for section in file.iter_sections():
            if not isinstance(section, SymbolTableSection):
                continue
            for symbol in section.iter_symbols():
                name, kind, where = symbol.name, symbol["st_info"]["type"], symbol["st_shndx"]
                if not name or where == "SHN_UNDEF" or name.startswith(("$t", "$d", "$a")):
                    continue
                value, size = symbol["st_value"], symbol["st_size"]
                if kind == "STT_FUNC":
                    address = value & ~1
                    known = found.get(address)
                    if known is None or known.size < size:
                        found[address] = Function(name, address, size)
                elif kind == "STT_OBJECT":
                    self.variables[name] = Variable(name, value, size)
                self.labels[name] = value
        self.functions = list(_apart(sorted(found.values(), key=lambda one: one.address)))

    def _read_lines(self) -> Iterator[Line]:
        from elftools.elf.elffile import ELFFile

        if self._elf is None:
            return
        file = ELFFile(BytesIO(self._elf))
        if not file.has_dwarf_info():
            return
        dwarf = file.get_dwarf_info()
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
                if before is None:  # what was left out by the linker begins at address 0
                    linked = self.function_at(state.address) is not None
                elif linked:
                    yield Line(
                        before.address,
                        state.address,
                        names.get(before.file, "?"),
                        before.line,
                        bool(before.is_stmt),
                    )
                before = None if state.end_sequence else state


def _apart(functions: list[Function]) -> Iterator[Function]:
    """Functions by address, each cut where the next one begins; one without a size ends there."""
    for index, function in enumerate(functions):
        follower = functions[index + 1].address if index + 1 < len(functions) else None
        size = function.size or 2
        if follower is not None and (not function.size or function.end > follower):
            size = min(size if function.size else 1 << 12, follower - function.address)
        yield Function(function.name, function.address, size)


def _file_names(program: Any, folder: str) -> dict[int, str]:
    """Paths by the numbers that a line program uses for them."""
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
