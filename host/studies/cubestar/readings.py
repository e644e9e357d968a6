"""Readings of CubeStar's printed calibration, and what each makes of the night test.

CubeStar thesis, section 5.4 and figure 5.12: the toolbox' coefficients, with inverted signs, are
those of equations 4.1.3 and 4.1.4. The toolbox fits them from undistorted to distorted points, the
equations map the other way. To second order, the inverse of 1 + a r^2 + b r^4 is
1 - a r^2 + (3 a^2 - b) r^4: with the printed a and b its second coefficient is +0.19, while the
inverted sign makes it -0.12. So inverting the
sign of b is right only where a is small, and keeping it is nearer here.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.optics import Distortion, Optics
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.firmware_model.attitude.geometry import CameraParameters, undistort, unit_vectors
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, PIXEL_PITCH_MM, ROWS
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments.cubestar.measure import CubeStarOpener
from cubestack.host.studies.cubestar.night import PRINTED_LENS, fields, pooled
from cubestack.host.studies.cubestar.shots import DEFAULT_MARGIN_RAD
from cubestack.host.studies.rows.trial import Figures

PRINTED = CameraParameters(
    LENS.focal_length_mm, LENS.fx, LENS.fy, LENS.cx, LENS.cy, LENS.k1, LENS.k2, LENS.p1, LENS.p2
)
"""The firmware's, with all signs inverted."""

FOCAL_PX = LENS.focal_length_mm / PIXEL_PITCH_MM
TOOLBOX_MM = LENS.fx * PIXEL_PITCH_MM
MIDDLE = {"cx": (COLUMNS - 1) / 2, "cy": (ROWS - 1) / 2}
GRID_STEP_PX = 16
PAIRS = 4000
GOOD_SHARE = 75.0  # percent of the pairs within the tolerance


@dataclass(frozen=True)
class Reading:
    """What differs from the printed text."""

    lens: Mapping[str, Any] = field(default_factory=dict)  #: of ``Optics``
    firmware: Mapping[str, float] = field(default_factory=dict)  #: of ``CameraParameters``
    margin_rad: float = DEFAULT_MARGIN_RAD

    @property
    def optics(self) -> Optics:
        return replace(PRINTED_LENS, **self.lens)

    @property
    def camera(self) -> CameraParameters:
        return replace(PRINTED, **self.firmware)

    @property
    def settings(self) -> dict[str, dict[str, float]]:
        """Telecommands that load the camera and the search tolerance."""
        camera = self.camera
        return {
            "setFocalLength": {"FocalLength": camera.focal_length_mm},
            "setFocalLengthComponents": {"Fx": camera.fx, "Fy": camera.fy},
            "setPrincipalPoint": {"Cx": camera.cx, "Cy": camera.cy},
            "setRadialDistortionGains": {"K1": camera.k1, "K2": camera.k2},
            "setTangentalDistortionGains": {"P1": camera.p1, "P2": camera.p2},
            "setIDMargin": {"Margin": self.margin_rad},
        }


READINGS: Mapping[str, Reading] = {
    "printed": Reading(),
    "kept": Reading(firmware={"k1": -LENS.k1, "k2": -LENS.k2, "p1": -LENS.p1, "p2": -LENS.p2}),
    "radial": Reading(firmware={"p1": -LENS.p1, "p2": -LENS.p2}),
    "first": Reading(firmware={"k2": -LENS.k2}),
    "first-alone": Reading(firmware={"k2": 0.0, "p1": 0.0, "p2": 0.0}),
    "swapped": Reading(firmware={"p1": LENS.p2, "p2": LENS.p1}),
    "focal": Reading(firmware={"fx": FOCAL_PX, "fy": FOCAL_PX}),
    "toolbox-focal": Reading(
        lens={"focal_length_mm": TOOLBOX_MM}, firmware={"focal_length_mm": TOOLBOX_MM}
    ),
    "middle": Reading(firmware=MIDDLE),
    "tolerance": Reading(margin_rad=2 * DEFAULT_MARGIN_RAD),
    "inverse": Reading(lens={"distortion": Distortion.INVERSE}),
}
"""By name; without a word of the lens it is the toolbox' model with the printed coefficients."""


def readings_of_signs() -> list[Reading]:
    """All signs, both orders of the tangential terms, focal lengths and principal points."""
    found = []
    for signs in product((1, -1), repeat=4):
        k1, k2, p1, p2 = np.array(signs) * (LENS.k1, LENS.k2, LENS.p1, LENS.p2)
        for tangential in ({"p1": p1, "p2": p2}, {"p1": p2, "p2": p1}):
            for scale in ({}, {"fx": FOCAL_PX, "fy": FOCAL_PX}):
                for centre in ({}, MIDDLE):
                    changes = {"k1": k1, "k2": k2, **tangential, **scale, **centre}
                    found.append(Reading(firmware=changes))
    return found


def error_px(reading: Reading) -> NDArray[np.float64]:
    """Distance (n,) in px of the firmware's directions from the true ones, over the image, at the
    attitude that fits best."""
    true, seen = _directions(reading)
    u, _, vt = np.linalg.svd(seen.T @ true)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    distance: NDArray[np.float64] = np.linalg.norm(seen - true @ rotation.T, axis=1)
    return distance * FOCAL_PX


def share_of_pairs(reading: Reading) -> float:
    """Percentage of pairs of stars, anywhere in the image, whose angle is within the tolerance."""
    true, seen = _directions(reading)
    one, other = np.random.default_rng(0).integers(len(true), size=(2, PAIRS))
    angles = [np.arccos(np.clip((v[one] * v[other]).sum(axis=1), -1, 1)) for v in (true, seen)]
    return 100 * float(np.mean(np.abs(angles[0] - angles[1]) < reading.margin_rad))


def _directions(reading: Reading) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """True and computed unit vectors (n, 3) of pixels over the image."""
    half = GRID_STEP_PX / 2
    y, x = np.mgrid[half:ROWS:GRID_STEP_PX, half:COLUMNS:GRID_STEP_PX]
    pixels, meter = np.stack([x.ravel(), y.ravel()], axis=1), Meter(CORTEX_M3)
    points = undistort(pixels.astype(np.float32), reading.camera, meter)
    seen = unit_vectors(points, reading.camera, meter).astype(float)
    return reading.optics.unproject(pixels), seen


def night_by(opened: CubeStarOpener, frames: int, reading: str) -> Figures:
    """Fields where the night test can take place, its scatter, and the error of the correction."""
    read = READINGS[reading]
    held = [one for one in fields(opened, frames, read.optics, read.settings) if one.is_held]
    distance = error_px(read)
    return {
        "held": len(held),
        "rms": float(np.sqrt(np.mean(distance**2))),
        "share": share_of_pairs(read),
        **dict.fromkeys(("ra", "dec", "roll"), np.nan),
        **pooled(held, frames),
    }


def signs(_opened: CubeStarOpener, _frames: int) -> Figures:
    """How many of ``readings_of_signs`` have most pairs within the tolerance, and the best ones."""
    shares = sorted(map(share_of_pairs, readings_of_signs()), reverse=True)
    return {
        "tried": len(shares),
        "good": sum(share >= GOOD_SHARE for share in shares),
        "best": shares[0],
        "printed": share_of_pairs(Reading()),
    }
