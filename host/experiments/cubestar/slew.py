"""A star tracker that turns: section 6.2 of the thesis, on a mount that does not shake."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.experiments.attitude import errors, is_right
from cubestack.host.experiments.cubestar.published_field import Shot
from cubestack.host.experiments.opener import Opener

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard

_Opener: TypeAlias = "Opener[CubeStarBoard, CubeStar]"

PICTURES = 10
"""Of one sky, a second apart: the first one lost in space, the others as the node's flag has it."""


def slewing(opened: _Opener, frames: int, rate_deg_s: float) -> Iterator[tuple[Shot, bool, float]]:
    """Pictures while turning across the boresight: each with whether it was tracked, and the error
    across in degrees, NaN unless it is right. ``Shot.wrong`` is not counted."""
    from cubestack.emulator.scene.attitude import random_quaternion
    from cubestack.emulator.scene.sky import SkyScene

    rng = np.random.default_rng(1)
    with opened(None, seed=1) as device:
        cubestar, client = device.client, device.client.client
        for number in range(frames):
            first = number % PICTURES == 0
            if first:
                side = rng.uniform(0, 2 * math.pi)
                turning = (rate_deg_s * math.cos(side), rate_deg_s * math.sin(side), 0.0)
                device.scene = SkyScene(
                    random_quaternion(rng), rate_deg_s=turning, mag_limit=3.8, seed=number
                )
            client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE if first else IdMode.TRACKING)
            due_s = device.time_s + 1
            cubestar.capture_and_process()
            attitude, truth = cubestar.attitude(), device.board.truth()
            assert truth is not None  # a sky has one
            detected = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
            cross, roll = errors(attitude.quaternion, truth)
            valid = attitude.valid
            right = valid and is_right(cross, roll)
            shot = Shot(valid, right, detected, attitude.matched if valid else 0, 0)
            yield shot, right and attitude.mode is MatchMode.TRACKING, cross if right else math.nan
            client.pause(max(0.0, due_s - device.time_s))
