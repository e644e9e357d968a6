"""The table of identification methods."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import nan
from typing import Protocol

import numpy as np

from cubestack.firmware_model.cubestar.matching import voting
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import Catalogue
from cubestack.host.studies.compare.identification.angle import Angle
from cubestack.host.studies.compare.identification.areas import PLANAR, SPHERICAL, Areas
from cubestack.host.studies.compare.identification.grid import Grid
from cubestack.host.studies.compare.identification.match_group import MatchGroup
from cubestack.host.studies.compare.identification.pyramid import Pyramid
from cubestack.host.studies.compare.identification.triangle import Triangle
from cubestack.host.studies.compare.tracker import NONE, Image, Indices


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


class Voting:
    """Geometric voting, as CubeStar's published program has it."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.listed, self.margin = catalogue.voting, catalogue.tracker.margin_rad
        self.used = catalogue.tracker.used
        self.database_bytes = self.listed.pair_bytes + self.listed.star_bytes
        self.ram_bytes = 2 * self.used * len(self.listed)  # a 16-bit counter for each name

    def __call__(self, image: Image, meter: Meter) -> Indices:
        rays = image.rays[: self.used]
        found = voting.identify(rays, self.listed, meter, margin_rad=self.margin)
        names = np.full(len(image.rays), NONE)
        names[: len(rays)] = found.stars
        return names


class Ours:
    """The device's own program, in profile `extended`."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.firmware = catalogue.tracker.firmware["extended"]
        self.database_bytes = self.firmware.database_bytes
        self.ram_bytes = nan  # its lists grow with the search, and nothing counts them

    def __call__(self, image: Image, meter: Meter) -> Indices:
        return self.firmware.identify(image, meter)


METHODS = (
    Method("triangle", "S 4.2.1.1", Triangle),
    Method("match group", "S 4.2.1.2", MatchGroup),
    Method("grid", "S 4.2.1.3, A 5.2", Grid),
    Method("angle", "A 5.3", Angle),
    Method("spherical triangle", "A 5.4", partial(Areas, shape=SPHERICAL)),
    Method("planar triangle", "A 5.5 to 5.8", partial(Areas, shape=PLANAR)),
    Method("geometric voting", "S 4.3", Voting),
    Method("pyramid", "S 4.2.2", Pyramid),
    Method("ours", "[identification](identification.md)", Ours),
)
