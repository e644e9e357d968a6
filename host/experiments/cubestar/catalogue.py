"""Compile CubeStar's onboard star catalogue from Hipparcos and say what is in it.

examples:
  cubestack catalogue cubestar                         as flown: V < 3.8
  cubestack catalogue cubestar --pair-limit 42.1       the published number of pairs
  cubestack catalogue cubestar --mag-limit 4 --json
"""

from dataclasses import dataclass
from typing import Any

from cubestack.host.devices.device import Shown
from cubestack.host.experiments.facts import Lookup
from cubestack.host.options import NUMBER, Options, option


@dataclass(frozen=True, kw_only=True)
class CatalogueOptions(Options):
    """What the catalogue is compiled for; None as it is flown."""

    mag_limit: float | None = option(None, "faintest star; default 3.8", NUMBER, metavar="V")
    epoch: float = option(2026.0, "default 2026", NUMBER, metavar="YEAR")
    pair_limit: float | None = option(None, "default: as flown", NUMBER, metavar="DEG")


class _Catalogue(Lookup[CatalogueOptions]):
    options = CatalogueOptions
    description = __doc__

    def look_up(self, options: CatalogueOptions, shown: Shown) -> dict[str, Any]:
        from cubestack.emulator.boards.cubestar import catalogue as flown

        mag_limit = flown.MAG_LIMIT if options.mag_limit is None else options.mag_limit
        pair_limit = flown.PAIR_LIMIT_DEG if options.pair_limit is None else options.pair_limit
        catalogue = flown.onboard_catalogue(mag_limit, pair_limit, options.epoch)
        return {
            "mag_limit": mag_limit,
            "pair_limit_deg": pair_limit,
            "epoch": options.epoch,
            "stars": len(catalogue),
            "star_bytes": catalogue.star_bytes,
            "pairs": len(catalogue.pairs),
            "pair_bytes": catalogue.pair_bytes,
            "closest_pairs_rad": [float(angle) for angle in catalogue.pairs.angle[:2]],
            "sha256": catalogue.sha256(),
        }


EXPERIMENT = _Catalogue()
