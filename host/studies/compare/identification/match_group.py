"""The match group algorithm: each star in turn is the pole that its neighbours are measured from.

CubeStar thesis, section 4.2.1.2 (after van Bezooijen). The star that is in the pairs of the most
neighbours is the pole; the neighbours are its partners; the group in which the most stars agree
with each other decides.
"""

import numpy as np

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import INDEX, Catalogue, MeasuredAngles
from cubestack.host.studies.compare.identification.agreement import FEWEST, agreeing
from cubestack.host.studies.compare.tracker import NONE, Image, Indices


class MatchGroup:
    """Has a table with a counter per listed star, and the pairs of all neighbours of a pole."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.vectors, self.pairs = catalogue.vectors, catalogue.pairs
        self.margin, self.used = catalogue.tracker.margin_rad, catalogue.tracker.used
        self.database_bytes = catalogue.pairs.bytes + catalogue.star_bytes
        widest = 2 * self.margin * len(self.pairs.angle) / catalogue.tracker.pair_limit_rad
        self.ram_bytes = round(len(self.vectors) * 2 + widest * self.used * 2 * INDEX)

    def __call__(self, image: Image, meter: Meter) -> Indices:
        count = min(self.used, len(image.rays))
        measured = MeasuredAngles(image.rays[:count], meter)
        best = np.full(count, NONE)
        for pole in range(count):
            names = agreeing(
                self._group(pole, measured, meter), measured.all, self.vectors, self.margin, meter
            )
            if np.count_nonzero(names != NONE) > np.count_nonzero(best != NONE):
                best = names
        if np.count_nonzero(best != NONE) < FEWEST:
            best[:] = NONE
        return np.append(best, np.full(len(image.rays) - count, NONE))

    def _group(self, pole: int, measured: MeasuredAngles, meter: Meter) -> Indices:
        """Names of the pole and its neighbours by its pairs alone."""
        count, stars = len(measured.all), len(self.vectors)
        names, tally = np.full(count, NONE), np.zeros(stars, np.intp)
        found = {}
        for other in range(count):
            if other != pole:
                first, second = self.pairs.within(measured(pole, other), self.margin, meter)
                ends, partners = np.append(first, second), np.append(second, first)
                found[other] = ends, partners
                tally[np.unique(ends)] += 1
                meter.charge(table_byte=2 * len(ends), i32_add=2 * len(ends))
        meter.charge(ram_read=stars // 2, i32_add=stars, loop=stars)
        star = int(tally.argmax())
        if tally[star] < FEWEST - 1:
            return names
        names[pole] = star
        for other, (ends, partners) in found.items():
            meter.charge(ram_read=len(ends), loop=len(ends))
            mine = partners[ends == star]
            if len(mine):
                apart = np.abs(
                    self.vectors[mine] @ self.vectors[star] - np.cos(measured.all[pole, other])
                )
                names[other] = mine[int(apart.argmin())]
        return names
