"""Identification of the published Algorithm 2 by search tolerance, on stars alone."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.firmware_model.cubestar.matching.voting import identify
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.rows.estimate import average, rate
from cubestack.host.studies.rows.trial import Figures

PUBLISHED_PAIR_LIMIT_DEG = 42.1

PX = 512 / math.tan(math.radians(27))
"""Focal length for the field of table 4.4: 54 x 28 degrees, no distortion."""

MARGINS_RAD = (0.001, 0.0015, 0.002)
SEED = 1

#: Magnitude limit and number of false stars, by the beginning of the figures' names.
SKIES = {
    **{f"v{v}": (v, 0) for v in (3.6, 3.7, 3.8)},
    **{f"false{count}": (3.8, count) for count in (1, 5, 10)},
}


def margins(_opened: Any, frames: int) -> Figures:
    """Percentages of images with three right stars and with a wrong one, and of the listed stars
    that are right, by sky and tolerance in 1e-4 rad."""
    catalogue = onboard_catalogue(pair_limit_deg=PUBLISHED_PAIR_LIMIT_DEG)
    figures = dict[str, float]()
    for sky, (v, false) in SKIES.items():
        for margin_rad in MARGINS_RAD:
            rng, rows = np.random.default_rng(SEED), []
            for _ in range(frames):
                rays, stars = centroids_alone(rng, v, false)
                found = identify(rays, catalogue, Meter(CORTEX_M3), margin_rad=margin_rad)
                right = found.stars[found.matched] == stars[found.matched]
                listed = max(1, np.count_nonzero(stars >= 0))
                rows.append((right.sum() > 2, not right.all(), 100 * right.sum() / listed))
            three, wrong, share = zip(*rows, strict=True)
            name = f"{sky} {round(margin_rad * 1e4)}"
            figures |= {f"{name} three": rate(three), f"{name} wrong": rate(wrong)}
            figures[f"{name} share"] = average(share)
    return figures


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
