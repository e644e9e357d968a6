"""Directions as a pair of angles, as sun and nadir sensors report them.

Alpha and beta are undistorted image coordinates in degrees, x (right) and y (down): their root sum
of squares is the angle from the boresight.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def vector_from_angles(alpha_deg: ArrayLike, beta_deg: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors (..., 3) in camera axes."""
    theta, phi = np.radians(np.hypot(alpha_deg, beta_deg)), np.arctan2(beta_deg, alpha_deg)
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )


def angles_from_vector(vector: ArrayLike) -> tuple[float, float]:
    """Alpha and beta of a direction (3,) in camera axes, of any length."""
    x, y, z = np.asarray(vector, np.float64)
    theta, phi = np.degrees(np.arctan2(np.hypot(x, y), z)), np.arctan2(y, x)
    return float(theta * np.cos(phi)), float(theta * np.sin(phi))
