"""Tables of figures are of stored measurements, or say here where their figures come from."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from tests.system.conftest import ROOT

DOCS = ROOT / "docs"

GENERATED = re.compile(r"<!-- (?!end).*?-->.*?<!-- end.*?-->", re.DOTALL)
"""What stands between marks is compared with its source by other tests."""

FIGURE = re.compile(r"[-+~<>*x ]*\d")


class Table(NamedTuple):
    """A table of a page."""

    head: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]

    @property
    def has_figures(self) -> bool:
        """Whether a column after the first has at least two cells, all of them figures."""
        columns = ([one for one in column if one] for column in zip(*self.body, strict=True))
        return any(
            len(column) > 1 and all(FIGURE.match(one) for one in column)
            for column in list(columns)[1:]
        )


def tables(text: str) -> Iterator[Table]:
    """Tables outside of marks and code."""
    plain = re.sub(r"^```.*?^```", "", GENERATED.sub("", text), flags=re.DOTALL | re.MULTILINE)
    for found in re.findall(r"(?:^\|.*\n)+", plain + "\n", re.MULTILINE):
        rows = [
            tuple(cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])
            for line in found.splitlines()
        ]
        if len(rows) > 2:
            yield Table(rows[0], tuple(rows[2:]))


MACHINE = "times and sizes of one machine, which no other repeats"
LONG = "takes hours, and the page has the command"
DECLARED = "declared or computed, not measured"

ELSEWHERE: dict[tuple[str, str], str] = {
    ("engines.md", "Top | compiled"): f"{MACHINE}: `make bench-engines`",
    ("engines.md", "first start"): MACHINE,
    ("gateware-cubestar-next.md", "Design | Arrangement"): "tests/hdl/test_area.py compares",
    ("gateware-tests.md", "Group | Points"): "tests/hdl/coverage compares",
    ("how-to/attitude-loop.md", "sensors | largest"): "an example beside other programs; Basilisk",
    ("how-to/campaigns-cluster.md", "skies"): f"{MACHINE}: `make bench-scale`",
    ("how-to/fpga-board.md", "for one image"): "counted in simulation of the board's gateware",
    ("how-to/fpga-board.md", "built with"): "of a placer that is not installed with the project",
    ("how-to/profiles.md", " | CubeStar"): DECLARED,
    ("identification.md", " | lens"): "tests/host/studies/test_lens_errors.py compares",
    ("layouts.md", "phase | cycles"): DECLARED,
    ("mutants.md", "Top | Possible"): LONG,
    ("mutants.md", "Tests | Killed"): LONG,
    ("reference/fault-kinds.md", " | virtual time"): LONG,
    ("reference/fault-kinds.md", " | answers on"): MACHINE,
    ("reference/ground-page.md", "measurement | after"): MACHINE,
    ("reference/i2c-bus.md", "device | telecommands"): DECLARED,
    ("reference/i2c-bus.md", " | seccomp"): MACHINE,
    ("reference/i2c-bus.md", " | bits per"): MACHINE,
    ("reference/orbit-files.md", "sensor | answers"): "an example of nine minutes",
    ("reference/versions.md", "kind | version"): "tests/system/test_versions.py compares",
    ("sensors/gateware-cubesense.md", "Operation | SHIFT"): DECLARED,
    ("sensors/gateware-cubesense.md", "Design | Tables"): "tests/hdl/test_area.py compares",
    ("simulator.md", "source | sequences"): "tests/emulator/iss/armv7m/test_cycles.py compares",
    ("simulator.md", "program | published"): "of other projects, compiled as these describe",
    ("simulator.md", "load | option"): MACHINE,
}
"""Page and beginning of a table, and why its figures are not stored."""

DERIVED = re.compile(r"sensors/(registers|protocols)")
"""Pages that are written from the interface tables."""


def test_a_column_of_figures_is_found() -> None:
    found = list(tables("| a | b |\n|-|-|\n| x | 1.5 ms |\n| y | < 3 |\n\n| a |\n|-|\n| 1 |\n"))
    assert [one.has_figures for one in found] == [True, False]
    assert not list(tables("<!-- rows: a -->\n| a | b |\n|-|-|\n| x | 1 |\n<!-- end of rows -->\n"))


def test_figures_in_tables_are_stored_or_say_why_not() -> None:
    found = {
        (path.relative_to(DOCS).as_posix(), " | ".join(table.head))
        for path in DOCS.rglob("*.md")
        for table in tables(path.read_text("utf-8"))
        if table.has_figures
    }
    named = {
        one: [key for key in ELSEWHERE if key[0] == one[0] and one[1].startswith(key[1])]
        for one in found
        if not DERIVED.match(one[0])
    }
    assert not {one for one, keys in named.items() if not keys}
    assert set(ELSEWHERE) == {key for keys in named.values() for key in keys}
