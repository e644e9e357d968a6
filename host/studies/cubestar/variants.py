"""What CubeStar's switches with other readings of the thesis change: remap, and the search after
an image that was solved."""

from dataclasses import replace
from functools import partial

import numpy as np

from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.experiments.cubestar.measure import CubeStarEmulated, CubeStarOpener
from cubestack.host.studies.cubestar.night import choose_threshold, set_threshold
from cubestack.host.studies.cubestar.shots import PICTURES, SEED, Shot, processed, slewing_shots
from cubestack.host.studies.rows.estimate import average, rate
from cubestack.host.studies.rows.trial import Figures, Trial

PUBLISHED_THRESHOLD = 6
"""In DN; section 5.3.3."""


def thresholds(opened: CubeStarOpener, frames: int, remap: str) -> Figures:
    """Of random skies with one camera: results at the published threshold and at one chosen.

    Rates in percent of ``right`` and, though valid, not right ``off``; ``centroids`` and ``chosen``
    threshold in DN in the mean, and its range.
    """
    rng, fixed, best, chosen = np.random.default_rng(SEED), list[Shot](), list[Shot](), list[int]()
    with opened(None, seed=SEED, set=f"remap={remap}") as device:
        for number in range(frames):
            device.scene = SkyScene(quaternion=random_quaternion(rng), seed=number)
            device.client.capture()
            set_threshold(device.client, PUBLISHED_THRESHOLD)
            fixed.append(_processed(device))
            chosen.append(choose_threshold(device.client))
            best.append(_processed(device))
    return {
        "right": rate(one.right for one in fixed),
        "off": rate(one.valid and not one.right for one in fixed),
        "centroids": average(one.detected for one in fixed),
        "best_right": rate(one.right for one in best),
        "best_off": rate(one.valid and not one.right for one in best),
        "chosen": average(chosen),
        "lowest": min(chosen),
        "highest": max(chosen),
    }


def _processed(device: CubeStarEmulated) -> Shot:
    """The stored image, lost in space."""
    device.client.client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
    return processed(device, device.client.process_image())


def following(opened: CubeStarOpener, frames: int, search: str, rate_deg_s: float) -> Figures:
    """While turning across the boresight, images one second apart; of those after the first, rates
    in percent and the longest and mean time of matching in ms."""
    times, shots = list[float](), list[Shot]()
    switched = replace(opened, board={**opened.board, "set": f"following={search}"})
    turning = slewing_shots(switched, frames, rate_deg_s)
    for number, (one, device) in enumerate(turning):
        if number % PICTURES:
            shots.append(one)
            times.append(device.client.phase_times()["match"])
    return {
        "right": rate(one.right for one in shots),
        "off": rate(one.valid and not one.right for one in shots),
        "share": average(100 * one.matched / max(1, one.detected) for one in shots),
        "match": average(times),
        "longest": max(times),
    }


RATES = (0.1333, 1.0)
"""In deg/s: of section 6.2, and beyond what tracking follows."""

VARIANTS = {
    **{
        f"following-{search}-{speed}": Trial(
            partial(following, search=search, rate_deg_s=speed), 30, 2, 3
        )
        for search in ("tracking", "assisted")
        for speed in RATES
    },
    **{
        f"remap-{kind}": Trial(partial(thresholds, remap=kind), 24, 1, 6)
        for kind in ("upper-bits", "stretched", "equalized")
    },
}
