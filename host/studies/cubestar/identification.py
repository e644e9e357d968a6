"""Identification alone, on centroids of random skies: its time in C++ and in Python."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH, load_sky
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.attitude.field_of_view import field_of_view
from cubestack.firmware_model.attitude.geometry import CameraParameters, undistort, unit_vectors
from cubestack.firmware_model.cubestar.matching.confirmed import identify
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import python_form

NOISE_PX, BORDER_PX, MOST = 0.05, 3, 40
LENS_NAMES = ("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
CAMERA = CameraParameters(**{name: getattr(LENS, name) for name in LENS_NAMES})
FIELD = field_of_view(CAMERA, LENS.columns, LENS.rows)
CATALOGUE = onboard_catalogue()

PICTURES = 200
"""Random skies of a benchmark."""

ROUNDS = 3
"""Turns of both forms, one after the other; the best of each counts."""


@dataclass(frozen=True)
class Centroids:
    """Of a picture: unit vectors (n, 3), brightest first, how many are listed stars, the truth."""

    rays: NDArray[np.float32]
    listed: int
    attitude: NDArray[np.float64]


def picture(rng: np.random.Generator, false: int, *, uncut: bool, mirrored: bool) -> Centroids:
    """Centroids at a random pose: listed stars or all that the camera may see, and false stars of
    magnitude 2 to 3.8; brightness is off by 0.05 mag."""
    attitude = matrix_from_quaternion(random_quaternion(rng))
    vectors, v_mag = CATALOGUE.vectors.astype(float), CATALOGUE.v_mag
    if uncut:
        sky = load_sky(DEFAULT_EPOCH, 5.5)
        vectors, v_mag = sky.vectors, sky.v_mag
    pixels = LENS.project(vectors @ attitude.T)
    size = np.array([LENS.columns, LENS.rows])
    seen = ((pixels > BORDER_PX) & (pixels < size - 1 - BORDER_PX)).all(axis=1)
    pixels, v_mag = pixels[seen], v_mag[seen]
    pixels = pixels + NOISE_PX * rng.standard_normal(pixels.shape)
    pixels = np.concatenate([pixels, rng.uniform([0, 0], size - 1, (false, 2))])
    v_mag = np.concatenate([v_mag, rng.uniform(2, 3.8, false)])
    listed = int(np.count_nonzero(v_mag[: len(pixels) - false] < CATALOGUE.mag_limit))
    order = np.argsort(v_mag + 0.05 * rng.standard_normal(len(v_mag)))[:MOST]
    meter = Meter(CORTEX_M3)
    rays = unit_vectors(undistort(pixels[order].astype(np.float32), CAMERA, meter), CAMERA, meter)
    return Centroids(rays * np.array([-1 if mirrored else 1, 1, 1], np.float32), listed, attitude)


def identification_figures() -> dict[str, float]:
    """Mean processor time in ms of an identification with 10 and with 20 false stars, and the
    Python form's time by it, in turn on the same pictures."""
    offer_firmware_loops()
    figures = {}
    for false in (10, 20):
        rng = np.random.default_rng(false)
        pictures = [picture(rng, false, uncut=False, mirrored=False) for _ in range(PICTURES)]
        compiled_ms, python_ms = [], []
        for _ in range(ROUNDS):
            compiled_ms.append(_mean_ms(pictures))
            with python_form():
                python_ms.append(_mean_ms(pictures))
        figures[f"identify_{false}_ms"] = round(min(compiled_ms), 3)
        figures[f"identify_{false}_ratio"] = round(min(python_ms) / min(compiled_ms), 2)
    return figures


def _mean_ms(pictures: list[Centroids]) -> float:
    started = time.process_time()
    for one in pictures:
        identify(one.rays, None, CATALOGUE, FIELD, Meter(CORTEX_M3))
    return 1000 * (time.process_time() - started) / len(pictures)
