"""Rightly named stars in a sequence of images, with the noise of the sensor.

The camera turns at a constant rate about a random axis. Stars stay in the image, so that all images
of a sequence have the same ones. Methods that use one image get the last.
"""

from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from cubestack.host.studies.compare.database import angles
from cubestack.host.studies.compare.skies import EXACT, take_image
from cubestack.host.studies.compare.tracker import Floats, Tracker

FRAMES = 10
STEP_S = 1.0
RATE_DEG_S = 0.1  #: chosen: within what the CubeStar thesis tracks (section 6.2)

_SAME_RAD = 1e-5


@dataclass(frozen=True)
class Case:
    """Which stars an image has, and how they are disturbed."""

    name: str
    noise: float = 1.0  #: times that of the sensor
    pair: bool = False  #: only two stars: the brightest
    near: bool = False  #: only two stars: those next to each other
    half_turn: bool = False  #: the attitude is a rotation by exactly 180 deg


CASES = (
    Case("as the sensor"),
    Case("noise x 3", noise=3.0),
    Case("two stars", pair=True),
    Case("two stars next to each other", near=True),
    Case("turned by 180 deg", half_turn=True),
)


@dataclass(frozen=True, eq=False)
class Trial:
    """A sequence of images."""

    frames: list[Floats]  #: directions (n, 3) in camera axes
    listed: Floats  #: the stars' directions (n, 3) in inertial axes
    truth: NDArray[np.float64]  #: attitude (3, 3) of the last image
    sigma_rad: float  #: error of a direction without the case's noise, each axis


def take_trial(tracker: Tracker, case: Case, seed: int, number: int) -> Trial | None:
    """The trial of a number; None if its sky has fewer than two stars of the list."""
    image = take_image(tracker, EXACT, seed, number)
    stars = tracker.stars.astype(np.float64)
    apart = np.linalg.norm(image.rays[:, None] - stars @ image.attitude.T, axis=2)
    named = apart.argmin(axis=1)[apart.min(axis=1) < _SAME_RAD][: tracker.used]
    if len(named) < 2:
        return None
    listed = stars[named]
    if case.pair:
        listed = listed[:2]
    if case.near:
        between = angles(listed[:, None], listed[None]) + np.eye(len(listed)) * np.pi
        listed = listed[list(np.unravel_index(between.argmin(), between.shape))]
    rng = np.random.default_rng([seed, number, 1])
    axis = _unit(rng.normal(size=3))
    truths = [
        _turn(axis, radians(RATE_DEG_S) * STEP_S * (at - FRAMES + 1)) @ image.attitude
        for at in range(FRAMES)
    ]
    if case.half_turn:
        about = _unit(rng.normal(size=3))
        axes = (2 * np.outer(about, about) - np.eye(3)).T @ image.attitude
        listed, truths = listed @ axes.T, [truth @ axes.T for truth in truths]
    sigma_rad = tracker.noise_px / tracker.focal_px
    frames = []
    for truth in truths:
        noise = rng.normal(size=listed.shape) * case.noise * sigma_rad
        frames.append(_unit(listed @ truth.T + noise).astype(np.float32))
    return Trial(frames, listed.astype(np.float32), truths[-1], sigma_rad)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found


def _turn(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    x, y, z = axis
    cross = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
    found: NDArray[np.float64] = (
        np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    )
    return found
