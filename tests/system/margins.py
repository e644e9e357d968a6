"""Identification rate of the published Algorithm 2 by search tolerance, for profiles.md.

::

    .venv/bin/python tests/system/margins.py --frames 2000

Prints the percentages of pictures with three right stars, of pictures with a wrong star, and of
right stars among the listed stars.
"""

import argparse
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.firmware_model.cubestar.matching.voting import identify
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

PUBLISHED_PAIR_LIMIT_DEG = 42.1

#: The field of table 4.4: 54 x 28 degrees, no distortion.
PX = 512 / math.tan(math.radians(27))


def centroids_alone(rng: Any, v: float, false: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """A random picture of the published field: unit vectors (n, 3) of the first 20 stars from the
    top, 0.03 px off, and their places in the list, -1 for false stars."""
    catalogue = onboard_catalogue(pair_limit_deg=PUBLISHED_PAIR_LIMIT_DEG)
    rays = catalogue.vectors @ matrix_from_quaternion(random_quaternion(rng)).T
    places = PX * rays[:, :2] / np.where(rays[:, 2:] > 0, rays[:, 2:], np.nan)
    seen = np.flatnonzero((np.abs(places) < [512, 256]).all(axis=1) & (catalogue.v_mag < v))
    lights = rng.uniform([-512, -256], [512, 256], (false, 2))
    points = np.concatenate([places[seen] + 0.03 * rng.standard_normal((len(seen), 2)), lights])
    order = np.argsort(points[:, 1])[:20]
    rays = np.column_stack([points, np.full(len(points), PX)])[order]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return rays.astype(np.float32), np.append(seen, np.full(false, -1))[order]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=200, help="frames of each line")
    frames = parser.parse_args().frames
    catalogue = onboard_catalogue(pair_limit_deg=PUBLISHED_PAIR_LIMIT_DEG)
    for v, false in ((3.6, 0), (3.7, 0), (3.8, 0), (3.8, 1), (3.8, 5), (3.8, 10)):
        cells = []
        for margin_rad in (0.001, 0.0015, 0.002):
            rng, rows = np.random.default_rng(1), []
            for _ in range(frames):
                rays, stars = centroids_alone(rng, v, false)
                meter = Meter(CORTEX_M3)
                found = identify(rays, catalogue, meter, margin_rad=margin_rad)
                named = found.stars[found.matched] == stars[found.matched]
                listed = max(1, np.count_nonzero(stars >= 0))
                rows.append((named.sum() > 2, not named.all(), named.sum() / listed))
            cells += [f"{100 * part:.1f}" for part in np.mean(rows, axis=0)]
        print(f"| V < {v}, {false} false |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
