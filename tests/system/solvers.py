"""Identification alone beside a public star identification, on the same centroids: an experiment
behind identification.md.

::

    pip install ruststartracker
    .venv/bin/python tests/system/solvers.py --frames 2000

The public one, ruststartracker, gets the same 405 stars and unit vectors, brightest first, and all
pairs of the field; four stars are a match. Its attitude is taken as it comes. Percent of pictures
with a right attitude, of those with four listed stars or more, wrong attitudes, and the mean
processor time of an identification.
"""

import argparse
import time
from collections.abc import Callable, Iterable

import numpy as np

from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments.attitude import is_right
from cubestack.host.studies.cubestar.identification import CATALOGUE, Centroids
from cubestack.host.studies.cubestar.stars_alone import (
    SEED,
    SKIES,
    Attitude,
    Rays,
    attitude_of,
    pictures,
    wrong_by,
)

Solver = Callable[[Rays], Attitude | None]


def ours(rays: Rays) -> Attitude | None:
    """By profile `extended`, with equal weights."""
    return attitude_of(rays, Meter(CORTEX_M3))


def public(tolerance_rad: float) -> Solver:
    """The solver ruststartracker with a tolerance of star angles."""
    from ruststartracker.libruststartracker import StarMatcher
    from scipy.spatial.transform import Rotation

    matcher = StarMatcher(
        CATALOGUE.vectors, CATALOGUE.v_mag.astype(np.float32), 100.0, 1.0, tolerance_rad, 4, 1.0
    )

    def solve(rays: Rays) -> Attitude | None:
        try:
            quaternion, *_ = matcher.find(np.ascontiguousarray(rays))
        except RuntimeError:
            return None
        return np.asarray(Rotation.from_quat(quaternion).as_matrix().T)

    return solve


def row(solve: Solver, skies: Iterable[Centroids], *, mirrored: bool) -> str:
    right = enough = wrong = four = count = 0
    spent = 0.0
    for each in skies:
        started = time.process_time()
        found = solve(each.rays)
        spent += time.process_time() - started
        good = found is not None and not mirrored and is_right(*wrong_by(found, each.attitude))
        right, wrong = right + good, wrong + (found is not None and not good)
        count, four = count + 1, four + (each.listed >= 4)
        enough += good and each.listed >= 4
    share, of_four = 100 * right / count, 100 * enough / max(1, four)
    return f"{share:.2f} ({of_four:.2f}), {wrong} wrong, {1000 * spent / count:.2f} ms"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=200, help="pictures of each line")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--lines", help="only lines whose name has this in it", default="")
    options = parser.parse_args()
    offer_firmware_loops()
    solvers: dict[str, Solver] = {"ours": ours}
    try:
        solvers |= {"public": public(0.0008), "public, half tolerance": public(0.0004)}
    except ImportError:
        print("ruststartracker is not installed: pip install ruststartracker")
    print("| |", " | ".join(solvers), "|")
    for name, how in SKIES.items():
        if options.lines in name:
            skies = list(pictures(name, options.frames, options.seed))
            mirrored = how.get("mirrored", False)
            cells = [row(solve, skies, mirrored=mirrored) for solve in solvers.values()]
            print(f"| {name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
