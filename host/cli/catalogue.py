"""Compile the onboard star catalogue from Hipparcos and say what is in it.

examples:
  cubestack catalogue                                  CubeStar's, as flown: V < 3.8
  cubestack catalogue --pair-limit 42.1                the published number of pairs
  cubestack catalogue --mag-limit 4 --json
  cubestack catalogue aramis                           AraMiS' stars and triangles
  cubestack catalogue aramis --epoch 2000 --fov 18 --output image.bin
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

from cubestack.host.cli.arguments import number, whole
from cubestack.host.cli.terminal import console, progress

__all__ = ["add_arguments", "run"]

#: Options that one device alone has.
ONLY = {
    "cubestar": ("pair_limit",),
    "aramis": ("fov", "stars_per_field", "step", "longest_side", "output"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "device", nargs="?", choices=tuple(ONLY), default="cubestar", help="default cubestar"
    )
    parser.add_argument(
        "--mag-limit", type=number, metavar="V", help="default 3.8, AraMiS 6 (included)"
    )
    parser.add_argument("--epoch", type=number, default=2026.0, metavar="YEAR", help="default 2026")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    cubestar = parser.add_argument_group("CubeStar")
    cubestar.add_argument("--pair-limit", type=number, metavar="DEG", help="default: as flown")
    aramis = parser.add_argument_group("AraMiS")
    aramis.add_argument(
        "--fov", type=number, metavar="DEG", help="diameter of the field, default 21.53"
    )
    aramis.add_argument(
        "--stars-per-field", type=whole(3, 50), metavar="N", help="brightest kept, default 6"
    )
    aramis.add_argument("--step", type=number, metavar="DEG", help="of the scan, default 1")
    aramis.add_argument(
        "--longest-side", type=number, metavar="DEG", help="of a triangle, default: the field"
    )
    aramis.add_argument("--output", type=Path, metavar="FILE", help="write the flash image")


def run(args: argparse.Namespace) -> int:
    """Compile and report."""
    for device, options in ONLY.items():
        for option in options:
            if device != args.device and getattr(args, option) is not None:
                name = option.replace("_", "-")
                raise ValueError(f"--{name} has no effect for {args.device}; it is {device}'s")
    facts = _aramis(args) if args.device == "aramis" else _cubestar(args)
    if args.json:
        print(json.dumps(facts))
        return 0
    for name, value in facts.items():
        console.print(f"{name.replace('_', ' '):>20}  {value}")
    return 0


def _cubestar(args: argparse.Namespace) -> dict[str, Any]:
    from cubestack.emulator.boards.cubestar.catalogue import (
        MAG_LIMIT,
        PAIR_LIMIT_DEG,
        onboard_catalogue,
    )

    mag_limit = MAG_LIMIT if args.mag_limit is None else args.mag_limit
    pair_limit = PAIR_LIMIT_DEG if args.pair_limit is None else args.pair_limit
    catalogue = onboard_catalogue(mag_limit, pair_limit, args.epoch)
    return {
        "mag_limit": mag_limit,
        "pair_limit_deg": pair_limit,
        "epoch": args.epoch,
        "stars": len(catalogue),
        "star_bytes": catalogue.star_bytes,
        "pairs": len(catalogue.pairs),
        "pair_bytes": catalogue.pair_bytes,
        "closest_pairs_rad": [float(angle) for angle in catalogue.pairs.angle[:2]],
        "sha256": catalogue.sha256(),
    }


def _aramis(args: argparse.Namespace) -> dict[str, Any]:
    import hashlib

    from cubestack.emulator.boards.aramis.catalogue import (
        PUBLISHED,
        CatalogueParameters,
        cached_database,
    )

    given = {
        "fov_deg": args.fov,
        "stars_per_field": args.stars_per_field,
        "mag_limit": args.mag_limit,
        "step_deg": args.step,
        "longest_side_deg": args.longest_side,
        "epoch": args.epoch,
    }
    parameters = CatalogueParameters(
        **{name: value for name, value in given.items() if value is not None}
    )
    start = time.monotonic()
    database = cached_database(
        parameters, lambda items, total, label: progress(items, total, label, quiet=args.json)
    )
    seconds = time.monotonic() - start
    image = database.pack()
    if args.output is not None:
        args.output.write_bytes(image)
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
