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
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.cubestar.matching.confirmed import identify
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments.attitude import is_right
from cubestack.host.studies.cubestar.identification import CATALOGUE, FIELD, Centroids, picture

Rays = NDArray[np.float32]
Attitude = NDArray[np.float64]
Solver = Callable[[Rays], tuple[float, Attitude | None]]


def ours(rays: Rays) -> tuple[float, Attitude | None]:
    """Time in s and attitude by profile `extended`, with equal weights."""
    offer_firmware_loops()
    meter = Meter(CORTEX_M3)
    started = time.process_time()
    found = identify(rays, None, CATALOGUE, FIELD, meter)
    spent = time.process_time() - started
    named = found.matched
    if not len(named):
        return spent, None
    measured = scaled(rays, 1 / found.scale, meter)[named]
    turn, _ = Rotation.align_vectors(measured, CATALOGUE.vectors[found.stars[named]])
    return spent, np.asarray(turn.as_matrix())


def public(tolerance_rad: float) -> Solver:
    """The solver ruststartracker with a tolerance of star angles."""
    from ruststartracker.libruststartracker import StarMatcher

    matcher = StarMatcher(
        CATALOGUE.vectors, CATALOGUE.v_mag.astype(np.float32), 100.0, 1.0, tolerance_rad, 4, 1.0
    )

    def solve(rays: Rays) -> tuple[float, Attitude | None]:
        started = time.process_time()
        try:
            quaternion, *_ = matcher.find(np.ascontiguousarray(rays))
        except RuntimeError:
            return time.process_time() - started, None
        spent = time.process_time() - started
        return spent, np.asarray(Rotation.from_quat(quaternion).as_matrix().T)

    return solve


def wrong_by(found: Attitude, truth: Attitude) -> tuple[float, float]:
    """Errors across and about the boresight, in degrees."""
    off = found @ truth.T
    roll = np.arctan2(off[0, 1] - off[1, 0], off[0, 0] + off[1, 1])
    return float(np.degrees(np.arccos(min(off[2, 2], 1.0)))), float(np.degrees(roll))


def row(solve: Solver, pictures: list[Centroids], *, mirrored: bool) -> str:
    right = enough = wrong = 0
    spent = 0.0
    for each in pictures:
        took, found = solve(each.rays)
        spent += took
        good = found is not None and not mirrored and is_right(*wrong_by(found, each.attitude))
        right, wrong = right + good, wrong + (found is not None and not good)
        enough += good and each.listed >= 4
    four = max(1, sum(each.listed >= 4 for each in pictures))
    share, of_four = 100 * right / len(pictures), 100 * enough / four
    return f"{share:.2f} ({of_four:.2f}), {wrong} wrong, {1000 * spent / len(pictures):.2f} ms"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=200, help="pictures of each line")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lines", help="only lines whose name has this in it", default="")
    options = parser.parse_args()
    solvers: dict[str, Solver] = {"ours": ours}
    try:
        solvers |= {"public": public(0.0008), "public, half tolerance": public(0.0004)}
    except ImportError:
        print("ruststartracker is not installed: pip install ruststartracker")
    cases: dict[str, dict[str, Any]] = {
        **{f"V < 3.8, {n} false stars": {"false": n} for n in (0, 5, 10, 20)},
        "uncut sky": {"uncut": True},
        "mirrored": {"mirrored": True},
    }
    print("| |", " | ".join(solvers), "|")
    for number, (name, case) in enumerate(cases.items()):
        if options.lines in name:
            rng = np.random.default_rng([options.seed, number])
            case = {"false": 0, "uncut": False, "mirrored": False, **case}
            pictures = [picture(rng, **case) for _ in range(options.frames)]
            cells = [row(s, pictures, mirrored=case["mirrored"]) for s in solvers.values()]
            print(f"| {name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
