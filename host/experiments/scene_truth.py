"""Rendered images and true positions of stars in them, for pictures; no device sees them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.host.pictures.images import TrueStar
from cubestack.host.pictures.sheet import Lens

BRIGHT = 3.8
"""Faintest marked magnitude V: the end of the CubeStar thesis' list, section 4.3.2."""


def true_stars(
    quaternion: NDArray[np.float64], lens: Lens, shape: tuple[int, ...], within_deg: float = 90.0
) -> list[TrueStar]:
    """Stars brighter than V = 3.8 in a picture (rows, columns), at their places of 2026.

    Args:
        quaternion: the true attitude (4,), scalar last, inertial to camera.
        lens: that took the picture.
        shape: of the picture.
        within_deg: angle from the boresight beyond which a shade blocks the light, at most 90.
    """
    sky = load_sky(mag_limit=BRIGHT)
    seen = sky.vectors @ matrix_from_quaternion(quaternion).T
    ahead = seen[:, 2] > max(0.0, float(np.cos(np.radians(within_deg))))
    places = lens(seen[ahead])
    inside = np.all((places >= 0) & (places <= np.array(shape[::-1]) - 1), axis=1)
    return [
        TrueStar(int(number), float(x), float(y))
        for number, (x, y) in zip(sky.hip[ahead][inside], places[inside], strict=True)
    ]


def cameras_of(board: Any) -> Sequence[Any]:
    return list(board.cameras.values()) if hasattr(board, "cameras") else [board.camera]


def picture_of(board: Any) -> NDArray[np.uint8] | None:
    """The last rendered images of all cameras side by side, or None."""
    rendered = [camera.rendered for camera in cameras_of(board)]
    shown = [picture for picture in rendered if picture is not None]
    return np.hstack(shown) if shown else None
