"""The contract of experiments: a device measured end to end, each result beside the truth."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

from cubestack.host.options import Options


class Result:
    """One result; a frozen dataclass whose attributes are those of the JSON output.

    An attribute ``right`` (True, False, or None if the truth is unknown) is what `--min-right`
    counts.
    """

    def as_dict(self) -> dict[str, Any]:
        return dict(vars(self))


@dataclass(frozen=True)
class Mark:
    """A published error, drawn beside ours."""

    error: str  #: name of ours in the results
    value: float  #: of it, in the unit of ours
    text: str  #: what it is, and its source


@dataclass(frozen=True)
class Section:
    """Part of a report about many results: a table, a figure as PNG, or both."""

    title: str  #: of it
    #: head, rows: cells of the table; none without rows
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    png: bytes = b""  #: of the figure; empty without


OpenerT = TypeVar("OpenerT")
OptionsT = TypeVar("OptionsT", bound=Options)
ResultT = TypeVar("ResultT", bound=Result)


class Experiment(ABC, Generic[OpenerT, OptionsT, ResultT]):
    """How a command measures one device, or looks up facts about it."""

    options: type[OptionsT]  #: what can be chosen
    description: str  #: for the help, with examples
    #: title, columns: of the table of results; the last column is text. No columns: no table
    title: str = ""
    columns: tuple[str, ...] = ()
    label: str = "measuring"  #: says what is going on, beside the progress bar; empty for none
    powers_up: bool = True  #: whether it needs the device, and not only its tables
    decides: tuple[str, ...] = ()  #: options of the board that the experiment sets itself
    marks: tuple[Mark, ...] = ()  #: published errors

    def count(self, options: OptionsT) -> int:
        """Number of results to expect."""
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
        """Summary of all results, line by line; they took ``wall_s``."""

    def sections(self, results: Iterable[Mapping[str, Any]]) -> Iterator[Section]:
        """Sections of a campaign's report besides the rates, from results as JSON has them.

        Raises ValueError without matplotlib.
        """
        yield from ()

    def succeeded(self, results: Sequence[ResultT]) -> bool:
        """Whether the run succeeded; by default, finding nothing is a success."""
        return True


#: Any experiment.
AnyExperiment: TypeAlias = Experiment[Any, Any, Any]
