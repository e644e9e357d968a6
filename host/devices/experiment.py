"""What an experiment is: a device measured end to end, each result beside the truth."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

from cubestack.host.options import Options


class Result:
    """One result; a frozen dataclass whose attributes are those of the JSON output.

    With an attribute ``right``, true, false, or None where the truth is not known, results can be
    judged by `--min-right`.
    """

    def as_dict(self) -> dict[str, Any]:
        return dict(vars(self))


@dataclass(frozen=True)
class Mark:
    """A published error, beside which ours are drawn.

    Attributes:
        error: name of ours in the results.
        value: of it, in the unit of ours.
        text: what it is, and its source.
    """

    error: str
    value: float
    text: str


@dataclass(frozen=True)
class Section:
    """Part of a report about many results: a table, a figure as PNG, or both.

    Attributes:
        title: of it.
        head, rows: cells of the table; none without rows.
        png: of the figure; empty without.
    """

    title: str
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    png: bytes = b""


OpenerT = TypeVar("OpenerT")
OptionsT = TypeVar("OptionsT", bound=Options)
ResultT = TypeVar("ResultT", bound=Result)


class Experiment(ABC, Generic[OpenerT, OptionsT, ResultT]):
    """How a command measures one device, or what it looks up about it.

    Attributes:
        options: what can be chosen.
        description: for the help, with examples.
        title, columns: of the table of results; the last column is text. No columns: no table.
        label: says what is going on, beside the progress bar; empty for none.
        powers_up: whether it needs the device, and not only its tables.
        decides: options of the board that the experiment sets itself.
        marks: published errors.
    """

    options: type[OptionsT]
    description: str
    title: str = ""
    columns: tuple[str, ...] = ()
    label: str = "measuring"
    powers_up: bool = True
    decides: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()

    def count(self, options: OptionsT) -> int:
        """How many results there will be."""
        return 1

    @abstractmethod
    def run(self, opened: OpenerT, options: OptionsT) -> Iterator[ResultT]:
        """Measure with the device that ``opened`` powers up, an ``experiments.opener.Opener``.

        Raises ValueError for a scene, a picture or a plan of faults that can not be used.
        """

    def row(self, number: int, result: ResultT) -> tuple[str, ...]:
        """A result in the table, by default its values: one cell for each of ``columns``.

        ``number`` counts from 0.
        """
        return tuple(map(str, result.as_dict().values()))

    @abstractmethod
    def summarise(self, results: Sequence[ResultT], wall_s: float) -> Iterable[str]:
        """What the results, which took ``wall_s``, are together: lines for a reader."""

    def sections(self, results: Iterable[Mapping[str, Any]]) -> Iterator[Section]:
        """What a campaign's report says of its results, as JSON has them, beside their rates.

        Raises ValueError without matplotlib.
        """
        yield from ()

    def succeeded(self, results: Sequence[ResultT]) -> bool:
        """Whether the run was a success; to find nothing is one, unless an experiment says else."""
        return True


#: An experiment with whatever device.
AnyExperiment: TypeAlias = Experiment[Any, Any, Any]
