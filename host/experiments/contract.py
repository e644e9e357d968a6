"""What an experiment is: a device measured end to end, each result beside the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from cubestack.host.devices.device import AnyDevice

__all__ = ["Experiment", "Result"]

OptionsT_contra = TypeVar("OptionsT_contra", contravariant=True)


class Result(Protocol):
    """One result; a frozen dataclass whose attributes are those of the JSON output."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""


ResultT = TypeVar("ResultT", bound=Result)


class Experiment(Protocol[OptionsT_contra, ResultT]):
    """How ``measure`` measures one device.

    Attributes:
        options: a frozen dataclass of what can be chosen; each field says in its metadata what the
            command's help says, and checks its value.
    """

    options: type[Any]

    def count(self, options: OptionsT_contra) -> int:
        """How many results there will be."""

    def run(self, device: AnyDevice, options: OptionsT_contra) -> Iterator[ResultT]:
        """Power the device up and measure; ValueError for options that do not go together."""

    def report(self, results: Sequence[ResultT], wall_s: float) -> None:
        """Show results as a table, with a summary, on the terminal."""
