"""Compile the onboard star catalogue from Hipparcos and say what is in it.

examples:
  cubestack catalogue                                  as flown: V < 3.8
  cubestack catalogue --pair-limit 42.1                the published number of pairs
  cubestack catalogue --mag-limit 4 --json
"""

import argparse
import json

from cubestack.host.cli.arguments import number
from cubestack.host.cli.terminal import console

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--mag-limit", type=number, default=3.8, metavar="V", help="default 3.8")
    parser.add_argument("--pair-limit", type=number, metavar="DEG", help="default: as flown")
    parser.add_argument("--epoch", type=number, default=2026.0, metavar="YEAR", help="default 2026")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    """Compile and report."""
    from cubestack.emulator.onboard_catalogue import PAIR_LIMIT_DEG, onboard_catalogue

    limit = PAIR_LIMIT_DEG if args.pair_limit is None else args.pair_limit
    catalogue = onboard_catalogue(args.mag_limit, limit, args.epoch)
    facts = {
        "mag_limit": args.mag_limit,
        "pair_limit_deg": limit,
        "epoch": args.epoch,
        "stars": len(catalogue),
        "star_bytes": catalogue.star_bytes,
        "pairs": len(catalogue.pairs),
        "pair_bytes": catalogue.pair_bytes,
        "closest_pairs_rad": [float(angle) for angle in catalogue.pairs.angle[:2]],
        "sha256": catalogue.sha256(),
    }
    if args.json:
        print(json.dumps(facts))
        return 0
    for name, value in facts.items():
        console.print(f"{name.replace('_', ' '):>18}  {value}")
    return 0
