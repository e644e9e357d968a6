"""An experiment that looks facts up, and needs no device for it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from cubestack.host.devices.device import Shown
from cubestack.host.devices.experiment import Experiment, Result, Summary
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options

__all__ = ["FactSummary", "Lookup"]

OptionsT = TypeVar("OptionsT", bound=Options)
ResultT = TypeVar("ResultT", bound=Result)


@dataclass(frozen=True)
class FactSummary(Summary):
    """Facts by name, in their order."""

    facts: dict[str, Any]

    def lines(self, wall_s: float) -> Iterator[str]:
        """One for each fact."""
        for name, value in self.facts.items():
            yield f"{name.replace('_', ' '):>20}  {value}"


class Lookup(Experiment[Opener[Any, Any], OptionsT, ResultT]):
    """Gives one result: facts."""

    label = ""
    powers_up = False

    @abstractmethod
    def look_up(self, options: OptionsT, shown: Shown) -> ResultT:
        """The facts; ValueError for options that make no sense."""

    def run(self, opened: Opener[Any, Any], options: OptionsT) -> Iterator[ResultT]:
        """Yield them."""
        yield self.look_up(options, opened.shown)

    def summarise(self, results: Sequence[ResultT]) -> Summary:
        """Each fact on a line."""
        (result,) = results
        return FactSummary(result.as_dict())
