"""Skies for all methods: stars of the catalogue at random attitudes, disturbed in one way each.

A sky's attitude, noise and false stars follow from the seed and its number, so cases with the same
number differ by their disturbance only.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.attitude import matrix_from_quaternion, random_quaternion
from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH, load_sky
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.tracker import Floats, Image, Tracker

BRIGHTNESS_MAG = 0.05  #: standard deviation of measured magnitudes (chosen)
MOST_FALSE = 10
SPOT_PX = 2.0  #: stars closer together are one spot, at the place of the brighter one (chosen)


@dataclass(frozen=True)
class Case:
    """How skies are disturbed."""

    name: str
    false: int = 0  #: false stars, at random places
    noise: float = 1.0  #: times that of the sensor
    missing: float = 0.0  #: probability that a star is not seen


EXACT = Case("exact", noise=0.0)
CASES = (
    Case("as the sensor"),
    Case("1 false", false=1),
    Case("3 false", false=3),
    Case("10 false", false=MOST_FALSE),
    Case("noise x 3", noise=3.0),
    Case("20 % missing", missing=0.2),
)


def take_image(tracker: Tracker, case: Case, seed: int, number: int) -> Image:
    """The stars of a sky."""
    rng = np.random.default_rng([seed, number])
    attitude = matrix_from_quaternion(random_quaternion(rng))
    sky = load_sky(DEFAULT_EPOCH, tracker.faintest_mag)
    ahead = sky.vectors @ attitude.T
    shift = case.noise * tracker.noise_px * rng.standard_normal((len(sky), 2))
    v_mag = sky.v_mag + BRIGHTNESS_MAG * rng.standard_normal(len(sky))
    lost = rng.uniform(size=len(sky)) < case.missing
    size = np.array([tracker.optics.columns, tracker.optics.rows])
    anywhere = rng.uniform([0, 0], size - 1, (8 * MOST_FALSE, 2))
    false_mag = rng.uniform(*tracker.false_mag, 8 * MOST_FALSE)

    seen = np.flatnonzero(_inside(tracker, ahead.astype(np.float32)) & ~lost)
    false = np.flatnonzero(_inside(tracker, _rays(tracker, anywhere)))[: case.false]
    seen = seen[_apart(tracker.optics.project(ahead[seen]), sky.v_mag[seen])]
    pixels = tracker.optics.project(ahead[seen]) + shift[seen]
    pixels = np.concatenate([pixels, anywhere[false]])
    magnitudes = np.concatenate([v_mag[seen], false_mag[false]])
    order = np.argsort(magnitudes, kind="stable")[: tracker.most]
    light = 10 ** (-0.4 * magnitudes[order])
    return Image(
        pixels[order].astype(np.float32),
        _rays(tracker, pixels[order]),
        light.astype(np.float32),
        attitude,
    )


def _apart(pixels: NDArray[np.float64], v_mag: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which stars (n,) are not in the spot of a brighter one."""
    near = np.linalg.norm(pixels[:, None] - pixels, axis=2) < SPOT_PX
    brighter = v_mag < v_mag[:, None]
    return np.asarray(~(near & brighter).any(axis=1))


def _rays(tracker: Tracker, pixels: NDArray[np.float64]) -> Floats:
    rays: Floats = tracker.optics.unproject(pixels).astype(np.float32)
    return rays


def _inside(tracker: Tracker, rays: Floats) -> NDArray[np.bool_]:
    """Which directions (n, 3) the image shows."""
    inside = rays[:, 2] > tracker.view.smallest_cosine
    ahead = np.flatnonzero(inside)
    inside[ahead] = tracker.view.contains(rays[ahead], Meter(tracker.table))
    return inside
