"""Compile CubeStar's onboard star catalogue from Hipparcos and say what is in it.

examples:
  cubestack catalogue cubestar                         as flown: V < 3.8
  cubestack catalogue cubestar --pair-limit 42.1       one pair less than published
  cubestack catalogue cubestar --mag-limit 4 --json
  cubestack catalogue cubestar --c catalogue.c         star list and pair list as C arrays
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubestack.emulator.boards.cubestar import catalogue as flown
from cubestack.firmware_model.values import number
from cubestack.host.devices.device import Shown
from cubestack.host.experiments.facts import Lookup
from cubestack.host.export.c_header import c_arrays
from cubestack.host.options import Options, output_option
from cubestack.host.output import write_output


@dataclass(frozen=True, kw_only=True)
class CatalogueOptions(Options):
    """Options of the catalogue; None means as flown."""

    mag_limit: float | None = number(None, "faintest star; default 3.8", metavar="V")
    epoch: float = number(2026.0, "default 2026", 1800, 2200, metavar="YEAR")
    pair_limit: float | None = number(None, "default: as flown", unit="deg")
    c: Path | None = output_option(None, "write star list and pair list as C arrays")


class _Catalogue(Lookup[CatalogueOptions]):
    options = CatalogueOptions
    description = __doc__

    def look_up(self, options: CatalogueOptions, shown: Shown) -> dict[str, Any]:
        mag_limit = flown.MAG_LIMIT if options.mag_limit is None else options.mag_limit
        pair_limit = flown.PAIR_LIMIT_DEG if options.pair_limit is None else options.pair_limit
        catalogue = flown.onboard_catalogue(mag_limit, pair_limit, options.epoch)
        if options.c is not None:
            about = (
                f"CubeStar's catalogue: V < {mag_limit:g}, pairs closer than {pair_limit:g} deg,"
                f" epoch {options.epoch:g}; SHA-256 of the arrays {catalogue.sha256()}"
            )
            write_output(options.c, c_arrays("catalogue", catalogue.arrays(), about))
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
