"""What a device declares of its published figures: rows, and the trials that measure ours."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from importlib import resources
from typing import Any, Literal, get_args

#: How our value comes about: it follows from the model, a constant was set so that it comes out,
#: a free choice makes it, or it is the source's own formula or setting.
Word = Literal["predicted", "fitted", "chosen", "definition"]
WORDS: tuple[Word, ...] = get_args(Word)

Figures = Mapping[str, float]


@dataclass(frozen=True)
class Trial:
    """An experiment that gives the figures of one row or several.

    Attributes:
        run: figures by name, of (opened, frames); nan for one that there is not. ``opened`` is an
            ``experiments.opener.Opener`` of the device in one profile.
        frames: of a whole run; 0 for what needs none.
        quick: of a quick one.
        seconds: wall time of a whole run in one profile, roughly, on one core.
        command: what a user types behind `cubestack` to see it; empty where
            `fidelity DEVICE --rows KEY` is the only one.
        profiles: whether the profile can make a difference.
    """

    run: Callable[[Any, int], Figures]
    frames: int = 0
    quick: int = 0
    seconds: float = 1.0
    command: str = ""
    profiles: bool = True


@dataclass(frozen=True)
class Row:
    """A published figure, and ours.

    Attributes:
        key: unique in the device; small letters, digits and dashes.
        figure: what it is, in words.
        source: section, table, or figure of the device's document.
        published: as the document has it.
        word: how ours comes about.
        trial: name of what measures it.
        ours: format of our value, with the names of the trial's figures.
    """

    key: str
    figure: str
    source: str
    published: str
    word: Word
    trial: str
    ours: str


@dataclass(frozen=True)
class Fidelity:
    """All published figures of a device.

    Attributes:
        page: file of the documentation that has the tables.
        trials: by name.
        tables: rows by the name of the table in the page, in its order.
    """

    page: str
    trials: Mapping[str, Trial]
    tables: Mapping[str, tuple[Row, ...]]

    @property
    def rows(self) -> Iterator[Row]:
        for rows in self.tables.values():
            yield from rows

    def command(self, device: str, row: Row) -> str:
        """What shows the row's value, behind `cubestack`."""
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
