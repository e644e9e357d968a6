"""A ground operator's procedures: find a detection threshold for a new sky, load a camera model.

CubeStar thesis, section 5.3.3: a threshold of 6 suits semi-urban skies; brighter ones need a higher
one. Section 5.3.4: with a good one the weights are similar, and close to the maximum. The search
uses only telecommands and telemetry.

Calibration tools fit Brown's model from undistorted points to pixels; CubeStar's firmware evaluates
it from pixels to undistorted points (CubeStar thesis, equations 4.1.3 to 4.1.5), and then divides
by its focal length (equation 4.1.6). The inverse of one is not exactly of the other's form, but
close. The firmware's model is linear in its coefficients, so linear least squares over the frame
give the best ones.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, PIXEL_PITCH_MM, ROWS
from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.calibration.camera import Camera
from cubestack.host.clients.cubestar.client import CubeStar

#: Thresholds to try in DN, about a quarter apart but at least one.
LADDER = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50, 63, 80, 100, 125, 160, 200)


def find_threshold(cubestar: CubeStar, views: Iterable[object] = (None,)) -> int | None:
    """Process images with each threshold, lost in space, and set the best; returns it in DN.

    The best identifies most stars that confirm each other; a tie goes to the higher one. An image
    is captured at each step of ``views``, which can change the pointing. Returns None, and restores
    the setting, if none gives an attitude.
    """
    client = cubestar.client
    before = client.telemetry("DetectionThresholdValues")
    agreeing = dict.fromkeys(LADDER, 0)
    for _ in views:
        cubestar.capture()
        for threshold in LADDER:
            _set(cubestar, threshold, threshold)
            client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
            cubestar.process_image()
            attitude = cubestar.attitude()
            if attitude.valid:
                most_votes = int(client.telemetry("MatchSummary")["MaxVotes"])
                agreeing[threshold] += min(attitude.matched, most_votes + 1)
    best = max(LADDER, key=lambda threshold: (agreeing[threshold], threshold))
    if not agreeing[best]:
        _set(cubestar, int(before["DetectionThreshold"]), int(before["StarThreshold"]))
        return None
    _set(cubestar, best, best)
    return best


def _set(cubestar: CubeStar, detection: int, star: int) -> None:
    cubestar.client.command(
        "setDetectionThresholds", DetectionThreshold=detection, StarThreshold=star
    )


GRID_STEP_PX = 8


@dataclass(frozen=True)
class Calibration:
    """Telecommands that load a camera, and how well the firmware's model describes it."""

    settings: dict[str, dict[str, float]]  #: telecommand to parameters, for ``CubeStar.configure``
    rms_px: float  #: root mean square distance over the frame, at the focal length
    max_px: float  #: largest distance


def calibrate(camera: Camera) -> Calibration:
    """Fit the firmware's parameters to ``camera`` over a frame of 1024 x 512 px.

    Raises ValueError if the camera's distortion cannot be inverted over the frame.
    """
    columns, rows = np.meshgrid(
        np.linspace(0, COLUMNS - 1, COLUMNS // GRID_STEP_PX),
        np.linspace(0, ROWS - 1, ROWS // GRID_STEP_PX),
    )
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=-1)
    true = camera.unproject(pixels)

    x, y = ((pixels - [camera.cx_px, camera.cy_px]) / camera.f_px).T
    r2 = x * x + y * y
    along_x = np.stack([x, x * r2, x * r2 * r2, 2 * x * y, r2 + 2 * x * x], axis=-1)
    along_y = np.stack([y, y * r2, y * r2 * r2, r2 + 2 * y * y, 2 * x * y], axis=-1)
    design = np.concatenate([along_x, along_y])
    # The first coefficient scales all; the focal length of the unit vectors absorbs it.
    coefficients = np.linalg.lstsq(design, np.concatenate([true[:, 0], true[:, 1]]), rcond=None)[0]
    scale = float(coefficients[0])
    k1, k2, p1, p2 = (float(value) / scale for value in coefficients[1:])

    fitted = (design @ coefficients).reshape(2, -1).T
    distance_px = camera.f_px * np.hypot(*(fitted - true).T)
    return Calibration(
        settings={
            "setFocalLength": {"FocalLength": camera.f_px * PIXEL_PITCH_MM / scale},
            "setFocalLengthComponents": {"Fx": camera.f_px, "Fy": camera.f_px},
            "setPrincipalPoint": {"Cx": camera.cx_px, "Cy": camera.cy_px},
            "setRadialDistortionGains": {"K1": k1, "K2": k2},
            "setTangentalDistortionGains": {"P1": p1, "P2": p2},
        },
        rms_px=float(np.sqrt(np.mean(distance_px**2))),
        max_px=float(distance_px.max()),
    )
