"""Compile AraMiS' onboard star catalogue from Hipparcos and say what is in it.

examples:
  cubestack catalogue aramis                           stars and triangles
  cubestack catalogue aramis --epoch 2000 --fov 18 --output image.bin
"""

import hashlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubestack.emulator.boards.aramis.catalogue import (
    PUBLISHED,
    CatalogueParameters,
    cached_database,
)
from cubestack.firmware_model.values import number, whole
from cubestack.host.devices.device import Shown
from cubestack.host.experiments.facts import Lookup
from cubestack.host.options import Options, output_option
from cubestack.host.output import write_output


@dataclass(frozen=True, kw_only=True)
class CatalogueOptions(Options):
    """Options of the catalogue; None means as flown."""

    mag_limit: float | None = number(None, "faintest star, included; default 6", metavar="V")
    epoch: float = number(2026.0, "default 2026", 1800, 2200, metavar="YEAR")
    fov: float | None = number(None, "diameter of the field, default 21.53", unit="deg")
    stars_per_field: int | None = whole(None, "brightest kept, default 6", 3, 50, metavar="N")
    step: float | None = number(None, "of the scan, default 1", unit="deg")
    longest_side: float | None = number(None, "of a triangle, default: the field", unit="deg")
    output: Path | None = output_option(None, "write the flash image")

    def parameters(self) -> CatalogueParameters:
        """Arguments of the catalogue's compiler; raises ValueError if invalid."""
        given: dict[str, Any] = {
            "fov_deg": self.fov,
            "stars_per_field": self.stars_per_field,
            "mag_limit": self.mag_limit,
            "step_deg": self.step,
            "longest_side_deg": self.longest_side,
            "epoch": self.epoch,
        }
        return CatalogueParameters(
            **{name: value for name, value in given.items() if value is not None}
        )


class _Catalogue(Lookup[CatalogueOptions]):
    options = CatalogueOptions
    description = __doc__

    def look_up(self, options: CatalogueOptions, shown: Shown) -> dict[str, Any]:
        parameters = options.parameters()
        start = time.monotonic()
        database = cached_database(parameters, shown)
        seconds = time.monotonic() - start
        image = database.pack()
        if options.output is not None:
            write_output(options.output, image)
        return {
            "fov_deg": parameters.fov_deg,
            "stars_per_field": parameters.stars_per_field,
            "mag_limit": parameters.mag_limit,
            "step_deg": parameters.step_deg,
            "longest_side_deg": parameters.side_deg,
            "epoch": parameters.epoch,
            "stars": len(database.numbers),
            "published_stars": PUBLISHED["stars"],
            "triangles": len(database),
            "published_triangles": PUBLISHED["triangles"],
            "star_numbers": "Hipparcos",
            "bytes": len(image),
            "bytes_of_parts": database.sizes,
            "seconds": round(seconds, 2),
            "sha256": hashlib.sha256(image).hexdigest(),
        }


EXPERIMENT = _Catalogue()
