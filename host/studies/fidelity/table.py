"""Published figures of devices: rows, trials that measure ours, and the tables of their pages.

Rows share trials: one set of images yields many figures. Each trial runs once per profile, several
in parallel.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from fnmatch import fnmatchcase
from importlib import resources
from typing import Literal, get_args

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.host.devices.experiment import Result
from cubestack.host.devices.registry import device as registered
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.rows.trial import Figures, Trial
from cubestack.host.studies.workers import performed

#: Origin of our value: it follows from the model, a constant was set to match it, it depends on a
#: free choice, or it is the source's own formula or setting.
Word = Literal["predicted", "fitted", "chosen", "definition"]
WORDS: tuple[Word, ...] = get_args(Word)


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
    #: by name; those without rows are for figures within the text of pages
    trials: Mapping[str, Trial]
    #: rows by the name of the table in the page, in its order
    tables: Mapping[str, tuple[Row, ...]]
    elsewhere: Mapping[str, str] = field(default_factory=dict)  #: files of tables that have another

    @property
    def rows(self) -> Iterator[Row]:
        for rows in self.tables.values():
            yield from rows

    def page_of(self, table: str) -> str:
        return self.elsewhere.get(table, self.page)

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


COLUMNS = ("figure", "source", "published", "`published`", "`extended`", "word", "command")


@dataclass(frozen=True)
class Job:
    """A trial to run."""

    #: device, trial: names
    device: str
    trial: str
    profile: str  #: of it; the first one where all are the same
    frames: int  #: how many
    seconds: float  #: roughly what it takes

    @property
    def key(self) -> str:
        """Its name in the device's record."""
        both = fidelity_of(self.device).trials[self.trial].profiles
        return f"{self.trial}, {self.profile}" if both else self.trial


@dataclass(frozen=True)
class Measured(Result):
    """A row with our values; attributes are those of the JSON output."""

    device: str  #: its name
    table: str  #: of the page
    #: key, figure, source, published, word: as declared
    key: str
    figure: str
    source: str
    published: str
    word: str
    command: str  #: arguments that show it
    ours: Mapping[str, str]  #: our measured values as text, by profile
    figures: Mapping[str, Figures]  #: their figures, by profile and name

    @property
    def cells(self) -> tuple[str, ...]:
        ours = (self.ours.get(profile, "") for profile in PROFILES)
        return (
            *(self.figure, self.source, self.published),
            *ours,
            *(self.word, f"`{self.command}`"),
        )


def fidelity_of(device: str) -> Fidelity:
    """A device's published figures; raises ValueError if it has none."""
    found = registered(device)
    if "fidelity" not in found.studies:
        raise ValueError(f"{found.name} declares no published figures")
    declared: Fidelity = found.study("fidelity")
    return declared


def chosen_rows(device: str, patterns: Sequence[str] = ()) -> list[tuple[str, Row]]:
    """(table, row) of a device whose keys match one of ``patterns``; default: all."""
    declared = fidelity_of(device)
    return [
        (table, row)
        for table, rows in declared.tables.items()
        for row in rows
        if not patterns or any(fnmatchcase(row.key, pattern) for pattern in patterns)
    ]


def jobs_of(
    device: str,
    names: Iterable[str],
    profiles: Sequence[str] = PROFILES,
    *,
    quick: bool = False,
    frames: int | None = None,
) -> list[Job]:
    """Jobs for these trials; ``frames`` replaces a trial's own number."""
    declared = fidelity_of(device)
    jobs = []
    for name in dict.fromkeys(names):
        trial = declared.trials[name]
        whole = trial.frames
        count = whole and (frames or (trial.quick if quick else whole))
        both = profiles if trial.profiles else profiles[:1]
        for profile in [trial.profile] if trial.profile else both:
            share = count / whole if whole else 1.0
            jobs.append(Job(device, name, profile, count, trial.seconds * share))
    return jobs


def perform(job: Job) -> Figures:
    """Run one job, in any process."""
    trial = fidelity_of(job.device).trials[job.trial]
    opened = Opener(registered(job.device), board={"profile": job.profile})
    return dict(trial.run(opened, job.frames))


def run_jobs(
    jobs: Sequence[Job], workers: int, on_done: Callable[[Job], None]
) -> dict[Job, Figures]:
    """Figures of all jobs, longest first; ``on_done`` is called with each finished one."""
    found: dict[Job, Figures] = {}
    order = sorted(jobs, key=lambda job: -job.seconds)
    for job, figures in performed(perform, order, workers):
        found[job] = figures
        on_done(job)
    return found


def filled(
    device: str, rows: Iterable[tuple[str, Row]], found: Mapping[Job, Figures]
) -> Iterator[Measured]:
    declared = fidelity_of(device)
    for table, row in rows:
        figures = {
            job.profile: values
            for job, values in found.items()
            if (job.device, job.trial) == (device, row.trial)
        }
        if not declared.trials[row.trial].profiles:
            figures = {profile: one for one in figures.values() for profile in PROFILES}
        ours = {profile: shown(row, values) for profile, values in figures.items()}
        yield Measured(
            *(device, table, row.key, row.figure, row.source, row.published, row.word),
            declared.command(device, row),
            ours,
            figures,
        )


def shown(row: Row, figures: Figures) -> str:
    """Our value as in the tables; a dash if missing."""
    return re.sub(r"\bnan\b", "-", row.ours.format(**figures))


# --- pages ----------------------------------------------------------------------------------------


def markdown(rows: Sequence[Measured]) -> str:
    lines = ["| " + " | ".join(COLUMNS) + " |", "|-" * len(COLUMNS) + "|"]
    lines += ["| " + " | ".join(row.cells) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def marks(table: str) -> tuple[str, str]:
    return f"<!-- rows: {table} -->\n", "<!-- end of rows -->\n"


def rewritten(page: str, rows: Iterable[Measured]) -> str:
    """A page with its tables replaced; raises ValueError with a table that it lacks."""
    rows = list(rows)
    for table in dict.fromkeys(row.table for row in rows):
        begin, end = marks(table)
        if begin not in page:
            raise ValueError(f"the page has no line {begin.strip()!r}")
        before, after = page.split(begin, 1)
        _, rest = after.split(end, 1)
        own = [row for row in rows if row.table == table]
        page = f"{before}{begin}\n{markdown(own)}\n{end}{rest}"
    return page
