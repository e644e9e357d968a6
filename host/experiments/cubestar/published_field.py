"""Pictures of the field that the thesis simulated: 54 x 28 degrees, no distortion (table 4.4)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cubestack.firmware_model.interface.cubestar import IdMode, TaskStatus
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.experiments.attitude import errors, is_right, rough_boresight
from cubestack.host.experiments.cubestar.measure import count_wrong, give_hint
from cubestack.host.experiments.opener import Opener

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.camera.common.optics import Optics

_Opener: TypeAlias = "Opener[CubeStarBoard, CubeStar]"

WIDTH_DEG = 54.0
DEFAULT_MARGIN_RAD = 0.001  # about a pixel (section 4.3.5)
SEED = 1


@dataclass(frozen=True)
class Shot:
    """One picture as the host saw it.

    Attributes:
        valid: it gave an attitude.
        right: the attitude is right.
        detected, matched, wrong: stars found, identified, and identified wrongly, whether or not
            they gave an attitude.
    """

    valid: bool
    right: bool
    detected: int
    matched: int
    wrong: int


def published_optics() -> "Optics":
    """The field of table 4.4 in front of CubeStar's sensor."""
    from cubestack.emulator.camera.mlx75412.lens import LENS

    focal_px = LENS.columns / 2 / math.tan(math.radians(WIDTH_DEG / 2))
    focal_mm = focal_px * LENS.pixel_pitch_um / 1000
    plain = replace(
        LENS, focal_length_mm=focal_mm, fx=focal_px, fy=focal_px, k1=0, k2=0, p1=0, p2=0
    )
    return replace(plain, cx=LENS.columns / 2 - 0.5, cy=LENS.rows / 2 - 0.5)


def calibrate(cubestar: CubeStar, optics: "Optics") -> None:
    """Tell the star tracker about a lens without distortion."""
    cubestar.configure(
        {
            "setFocalLength": {"FocalLength": optics.focal_length_mm},
            "setFocalLengthComponents": {"Fx": optics.fx, "Fy": optics.fy},
            "setPrincipalPoint": {"Cx": optics.cx, "Cy": optics.cy},
            "setRadialDistortionGains": {"K1": 0.0, "K2": 0.0},
            "setTangentalDistortionGains": {"P1": 0.0, "P2": 0.0},
        }
    )


def shots(
    opened: _Opener,
    frames: int,
    hint_deg: float | None = None,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    **sky: Any,
) -> Iterator[Shot]:
    """Pictures of random skies, lost in space, or at most ``hint_deg`` from a rough boresight.

    ``margin_rad``: search tolerance. ``sky``: of a ``SkyScene``, as mag_limit and false_stars.
    """
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.camera.mlx75412.lens import CONDITION
    from cubestack.emulator.scene.attitude import random_quaternion
    from cubestack.emulator.scene.sky import SkyScene

    rng, optics = np.random.default_rng(SEED), published_optics()
    with opened(None, seed=SEED) as emulated:
        cubestar, client = emulated.client, emulated.client.client
        calibrate(cubestar, optics)
        client.command("setIDMargin", Margin=margin_rad)
        for number in range(frames):
            scene = SkyScene(quaternion=random_quaternion(rng), seed=number, **sky)
            emulated.scene = SkyView(scene, replace(CONDITION, optics=optics, seed=number))
            lost = hint_deg is None
            client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE if lost else IdMode.TRACKING)
            if hint_deg is not None:
                give_hint(cubestar, rough_boresight(scene.truth(0), hint_deg, rng))
            status = cubestar.capture_and_process()
            attitude, truth = cubestar.attitude(), emulated.board.truth()
            assert truth is not None  # a sky has one
            valid = attitude.valid
            detected = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
            named = valid or status is TaskStatus.CALCULATION_FAILED
            matched = int(client.telemetry("NumIdStars")["numIdStars"]) if named else 0
            wrong = (count_wrong(cubestar, truth) or 0) if named else 0
            right = valid and is_right(*errors(attitude.quaternion, truth))
            yield Shot(valid, right, detected, matched, wrong)
