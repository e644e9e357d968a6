"""Geometric voting, as CubeStar's published program has it, for `cubestack compare`."""

import numpy as np

from cubestack.firmware_model.cubestar.catalogue import PairList, StarCatalogue
from cubestack.firmware_model.cubestar.matching import voting
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.attitude.methods import Method as AttitudeMethod
from cubestack.host.studies.compare.database import Catalogue
from cubestack.host.studies.compare.identification.methods import Method
from cubestack.host.studies.compare.tracker import NONE, Image, Indices


class Voting:
    """CubeStar thesis, section 4.3, with a table of 16-bit counters for each name."""

    def __init__(self, catalogue: Catalogue) -> None:
        tracker, pairs = catalogue.tracker, catalogue.pairs
        self.listed = StarCatalogue(
            tracker.stars,
            PairList(pairs.first.astype(np.uint16), pairs.second.astype(np.uint16), pairs.angle),
            np.arange(len(tracker.stars)),
            tracker.v_mag,
            tracker.faintest_mag,
            float(np.degrees(tracker.pair_limit_rad)),
        )
        self.margin, self.used = tracker.margin_rad, tracker.used
        self.database_bytes = self.listed.pair_bytes + self.listed.star_bytes
        self.ram_bytes = 2 * self.used * len(self.listed)

    def __call__(self, image: Image, meter: Meter) -> Indices:
        rays = image.rays[: self.used]
        found = voting.identify(rays, self.listed, meter, margin_rad=self.margin)
        names = np.full(len(image.rays), NONE)
        names[: len(rays)] = found.stars
        return names


IDENTIFICATION = (Method("geometric voting", "S 4.3", Voting),)
ATTITUDE: tuple[AttitudeMethod, ...] = ()
