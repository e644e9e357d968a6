"""The angle method: pairs of one star, the pivot, with others until one listed star is left.

AraMiS thesis, section 5.3. Each further star keeps those listed stars that have a pair as far apart
too. The list of pairs is compiled with a spherical quadtree (``quadtree``). Nothing is verified.
"""

import numpy as np

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import Catalogue, MeasuredAngles
from cubestack.host.studies.compare.tracker import NONE, Image, Indices

FEWEST_PARTNERS = 2


class Angle:
    """Uses the pairs of the pivot alone, the brightest star first."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.pairs, self.margin = catalogue.pairs, catalogue.tracker.margin_rad
        self.stars, self.used = len(catalogue.vectors), catalogue.tracker.used
        self.database_bytes = catalogue.pairs.bytes + catalogue.star_bytes
        self.ram_bytes = 2 * self.stars // 8  # two sets of stars

    def __call__(self, image: Image, meter: Meter) -> Indices:
        measured = MeasuredAngles(image.rays, meter)
        count = min(self.used, len(image.rays))
        for pivot in range(count):
            others = [star for star in range(count) if star != pivot]
            names = self._try(pivot, others, measured, meter)
            if names is not None:
                return names
        return np.full(len(image.rays), NONE)

    def _try(
        self, pivot: int, others: list[int], measured: MeasuredAngles, meter: Meter
    ) -> Indices | None:
        """Names by a pivot that one listed star can be; None if no star or several are left."""
        left = np.ones(self.stars, bool)
        found = {}
        for other in others:
            first, second = self.pairs.within(measured(pivot, other), self.margin, meter)
            found[other] = ends, partners = np.append(first, second), np.append(second, first)
            shared = np.zeros(self.stars, bool)
            shared[ends] = True
            left &= shared
            meter.charge(table_byte=len(ends), ram_read=self.stars // 32, loop=self.stars // 32)
            if not left.any():
                return None
            if len(found) >= FEWEST_PARTNERS and np.count_nonzero(left) == 1:
                star = int(left.argmax())
                break
        else:
            return None
        names = np.full(len(measured.all), NONE)
        names[pivot] = star
        for other, (ends, partners) in found.items():
            mine = partners[ends == star]
            meter.charge(ram_read=len(ends), loop=len(ends))
            if len(mine) == 1:
                names[other] = mine[0]
        return names
