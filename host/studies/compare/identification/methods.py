"""The table of identification methods."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from typing import Protocol

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import Catalogue
from cubestack.host.studies.compare.identification.angle import Angle
from cubestack.host.studies.compare.identification.grid import Grid
from cubestack.host.studies.compare.identification.match_group import MatchGroup
from cubestack.host.studies.compare.identification.pyramid import Pyramid
from cubestack.host.studies.compare.identification.triangle import Triangle
from cubestack.host.studies.compare.tracker import Image, Indices, alternatives


class Identifier(Protocol):
    """A method with its database."""

    @property
    def database_bytes(self) -> int:
        """As the part would store it."""

    @property
    def ram_bytes(self) -> float:
        """Of its largest tables, beside the measured stars; nan if not known."""

    def __call__(self, image: Image, meter: Meter) -> Indices:
        """The star (n,) in the list for each measured one, or ``NONE``; charges the meter."""


@dataclass(frozen=True)
class Method:
    """A method of the table."""

    name: str
    source: str  #: sections that describe it
    build: Callable[[Catalogue], Identifier]


class Ours:
    """The device's own program, in profile `extended`."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.firmware = catalogue.tracker.firmware["extended"]
        self.database_bytes = self.firmware.database_bytes
        self.ram_bytes = nan  # its lists grow with the search, and nothing counts them

    def __call__(self, image: Image, meter: Meter) -> Indices:
        return self.firmware.identify(image, meter)


_FIRST = (
    Method("triangle", "S 4.2.1.1", Triangle),
    Method("match group", "S 4.2.1.2", MatchGroup),
    Method("grid", "S 4.2.1.3, A 5.2", Grid),
    Method("angle", "A 5.3", Angle),
)
_LAST = (
    Method("pyramid", "S 4.2.2", Pyramid),
    Method("ours", "[identification](identification.md)", Ours),
)


def methods() -> Sequence[Method]:
    """All in the order of the tables, with those of the devices' own programs."""
    return (*_FIRST, *(one for offered in alternatives() for one in offered.IDENTIFICATION), *_LAST)
