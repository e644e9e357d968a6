"""A device's published figures: rows, and the trials that measure ours."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from importlib import resources
from typing import Any, Literal, get_args

#: Origin of our value: it follows from the model, a constant was set to match it, it depends on a
#: free choice, or it is the source's own formula or setting.
Word = Literal["predicted", "fitted", "chosen", "definition"]
WORDS: tuple[Word, ...] = get_args(Word)

Figures = Mapping[str, float]


@dataclass(frozen=True)
class Trial:
    """An experiment for the figures of one or more rows."""

    #: figures by name, of (opened, frames); nan for a missing one. ``opened`` is an
    #: ``experiments.opener.Opener`` of the device in one profile
    run: Callable[[Any, int], Figures]
    frames: int = 0  #: of a whole run; 0 if it needs none
    quick: int = 0  #: of a quick one
    seconds: float = 1.0  #: wall time of a whole run in one profile, roughly, on one core
    #: arguments of `cubestack` that show it; empty if only `fidelity DEVICE --rows KEY` does
    command: str = ""
    profiles: bool = True  #: whether the profile matters


@dataclass(frozen=True)
class Row:
    """A published figure, and ours."""

    key: str  #: unique in the device; small letters, digits and dashes
    figure: str  #: what it is, in words
    source: str  #: section, table, or figure of the device's document
    published: str  #: as the document has it
    word: Word  #: origin of our value
    trial: str  #: name of its trial
    ours: str  #: format of our value, with the names of the trial's figures


@dataclass(frozen=True)
class Fidelity:
    """All published figures of a device."""

    page: str  #: file of the documentation that has the tables
    trials: Mapping[str, Trial]  #: by name
    #: rows by the name of the table in the page, in its order
    tables: Mapping[str, tuple[Row, ...]]

    @property
    def rows(self) -> Iterator[Row]:
        for rows in self.tables.values():
            yield from rows

    def command(self, device: str, row: Row) -> str:
        """Arguments of `cubestack` that show the row's value."""
        return self.trials[row.trial].command or f"fidelity {device} --rows {row.key}"


def read_tables(package: str) -> Mapping[str, tuple[Row, ...]]:
    """The tables in a package's file `published.md`, each below a heading of the second level.

    Their columns are the attributes of ``Row``. Raises ValueError for a line that is no row.
    """
    names = [field.name for field in fields(Row)]
    tables: dict[str, tuple[Row, ...]] = {}
    for line in resources.files(package).joinpath("published.md").read_text("utf-8").splitlines():
        if line.startswith("## "):
            table = line.removeprefix("## ")
            tables[table] = ()
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if not cells or cells == names or cells[0] == "-":
            continue
        if len(cells) != len(names) or cells[names.index("word")] not in WORDS:
            raise ValueError(f"{package}: not the cells of {', '.join(names)}: {line}")
        tables[table] += (Row(*cells),)  # type: ignore[arg-type]
    return tables
