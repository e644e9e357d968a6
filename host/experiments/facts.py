"""Experiments whose result is a set of facts; most need no device."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from cubestack.host.devices.device import Shown
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options

OptionsT = TypeVar("OptionsT", bound=Options)


@dataclass(frozen=True)
class Facts(Result):
    """Facts by name; ``lines`` is their text, by default a line each."""

    facts: dict[str, Any]
    lines: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        return self.facts


def fact_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    for name, value in facts.items():
        yield f"{name.replace('_', ' '):>20}  {value}"


class Telling(Experiment[Opener[Any, Any], OptionsT, Facts]):
    """An experiment with one result: facts."""

    label = ""

    def summarise(self, results: Sequence[Facts], wall_s: float) -> Iterable[str]:
        """Their own lines, or each fact on one."""
        return results[0].lines or fact_lines(results[0].facts)


class Lookup(Telling[OptionsT]):
    """Facts that need no device."""

    powers_up = False

    @abstractmethod
    def look_up(self, options: OptionsT, shown: Shown) -> dict[str, Any]:
        """The facts by name; raises ValueError for invalid options."""

    def run(self, opened: Opener[Any, Any], options: OptionsT) -> Iterator[Facts]:
        yield Facts(self.look_up(options, opened.shown))
