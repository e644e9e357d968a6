"""Images of random skies as the host sees them: with the published field, and while turning."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode, TaskStatus
from cubestack.host.calibration.camera import Camera
from cubestack.host.clients.cubestar.operator import calibrate
from cubestack.host.experiments import attitude as attitudes
from cubestack.host.experiments.cubestar import measure

WIDTH_DEG = 54.0
DEFAULT_MARGIN_RAD = 0.001  # about a pixel (section 4.3.5)
SEED = 1

PICTURES = 10
"""Images per sky, a second apart: the first lost in space, the others as the node's flag says."""


@dataclass(frozen=True)
class Shot:
    """One picture."""

    valid: bool  #: it gave an attitude
    right: bool  #: the attitude is right
    tracked: bool  #: it is right, and was found by tracking
    cross_deg: float  #: error across; NaN unless it is right
    #: detected, matched, wrong: stars found, identified, and identified wrongly
    detected: int
    matched: int
    wrong: int = 0


def _shot(device: measure.CubeStarEmulated, *, judged: bool = False) -> Shot:
    """Capture one; ``judged`` counts stars without an attitude too, and wrong ones."""
    return processed(device, device.client.capture_and_process(), judged=judged)


def processed(
    device: measure.CubeStarEmulated, status: TaskStatus, *, judged: bool = False
) -> Shot:
    """Of the image that was processed last, up to a step."""
    cubestar, client = device.client, device.client.client
    attitude, truth = cubestar.attitude(), device.board.truth()
    assert truth is not None  # a sky has one
    detected = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
    cross_deg, roll_deg = attitudes.errors(attitude.quaternion, truth)
    valid = attitude.valid
    right = valid and attitudes.is_right(cross_deg, roll_deg)
    tracked = right and attitude.mode is MatchMode.TRACKING
    matched, wrong = attitude.matched if valid else 0, 0
    if judged and (valid or status is TaskStatus.CALCULATION_FAILED):
        matched = int(client.telemetry("NumIdStars")["numIdStars"])
        wrong = measure.count_wrong(cubestar, truth) or 0
    return Shot(valid, right, tracked, cross_deg if right else math.nan, detected, matched, wrong)


def published_optics() -> Optics:
    """The field of table 4.4 in front of CubeStar's sensor: 54 x 28 degrees, no distortion."""
    focal_px = LENS.columns / 2 / math.tan(math.radians(WIDTH_DEG / 2))
    focal_mm = focal_px * LENS.pixel_pitch_um / 1000
    middle = replace(LENS, cx=LENS.columns / 2 - 0.5, cy=LENS.rows / 2 - 0.5)
    return replace(
        middle, focal_length_mm=focal_mm, fx=focal_px, fy=focal_px, k1=0, k2=0, p1=0, p2=0
    )


def field_shots(
    opened: measure.CubeStarOpener,
    frames: int,
    hint_deg: float | None = None,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    **sky: Any,
) -> Iterator[Shot]:
    """Of the published field, lost in space, or at most ``hint_deg`` from a rough boresight.

    ``margin_rad``: search tolerance. ``sky``: of a ``SkyScene``, as mag_limit and false_stars.
    """
    rng, optics = np.random.default_rng(SEED), published_optics()
    with opened(None, seed=SEED) as device:
        cubestar, client = device.client, device.client.client
        cubestar.configure(calibrate(Camera(optics.fx, optics.cx, optics.cy)).settings)
        client.command("setIDMargin", Margin=margin_rad)
        for number in range(frames):
            scene = SkyScene(quaternion=random_quaternion(rng), seed=number, **sky)
            device.scene = SkyView(scene, replace(CONDITION, optics=optics, seed=number))
            lost = hint_deg is None
            client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE if lost else IdMode.TRACKING)
            if hint_deg is not None:
                measure.give_hint(
                    cubestar, attitudes.rough_boresight(scene.truth(0), hint_deg, rng)
                )
            yield _shot(device, judged=True)


def slewing_shots(
    opened: measure.CubeStarOpener, frames: int, rate_deg_s: float
) -> Iterator[tuple[Shot, measure.CubeStarEmulated]]:
    """While turning across the boresight: section 6.2, on a mount that does not shake; each with
    the device, for the caller to read more of it."""
    rng = np.random.default_rng(SEED)
    with opened(None, seed=SEED) as device:
        for number in range(frames):
            first = number % PICTURES == 0
            if first:
                side = rng.uniform(0, 2 * math.pi)
                turning = (rate_deg_s * math.cos(side), rate_deg_s * math.sin(side), 0.0)
                device.scene = SkyScene(
                    random_quaternion(rng), rate_deg_s=turning, mag_limit=3.8, seed=number
                )
            mode = IdMode.LOST_IN_SPACE if first else IdMode.TRACKING
            device.client.client.command("setIDMode", IdMode=mode)
            due_s = device.time_s + 1
            yield _shot(device), device
            device.client.client.pause(max(0.0, due_s - device.time_s))
