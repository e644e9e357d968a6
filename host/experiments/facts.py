"""Experiments that look facts up, and need no device for it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from cubestack.host.devices.device import Shown
from cubestack.host.devices.experiment import Experiment, Result, Summary
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options

OptionsT = TypeVar("OptionsT", bound=Options)


@dataclass(frozen=True)
class Facts(Result):
    """Facts by name, in their order."""

    facts: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self.facts


@dataclass(frozen=True)
class FactSummary(Summary):
    """Facts by name, in their order, for a reader."""

    facts: dict[str, Any]

    def lines(self, wall_s: float) -> Iterator[str]:
        """One for each fact."""
        for name, value in self.facts.items():
            yield f"{name.replace('_', ' '):>20}  {value}"


class Lookup(Experiment[Opener[Any, Any], OptionsT, Facts]):
    """Gives one result: facts."""

    label = ""
    powers_up = False

    @abstractmethod
    def look_up(self, options: OptionsT, shown: Shown) -> dict[str, Any]:
        """The facts by name; ValueError for options that make no sense."""

    def run(self, opened: Opener[Any, Any], options: OptionsT) -> Iterator[Facts]:
        """Yield them."""
        yield Facts(self.look_up(options, opened.shown))

    def summarise(self, results: Sequence[Facts]) -> Summary:
        """Each fact on a line."""
        return FactSummary(results[0].facts)
