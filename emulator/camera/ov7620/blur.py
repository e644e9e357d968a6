"""Defocus: each point of the image becomes a Gaussian spot."""

import math

import numpy as np
from numpy.typing import NDArray

REACH_SIGMAS = 4.0


def blur(light: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    """``light`` (rows, columns) with spots of this standard deviation; dark beyond the edges."""
    half = math.ceil(REACH_SIGMAS * sigma_px)
    edges = (np.arange(2 * half + 2) - half - 0.5) / (sigma_px * math.sqrt(2))
    shares = np.diff([math.erf(edge) for edge in edges])
    shares /= shares.sum()
    return _along_rows(_along_rows(light, shares).T, shares).T


def _along_rows(light: NDArray[np.float32], shares: NDArray[np.float64]) -> NDArray[np.float32]:
    half, columns = len(shares) // 2, light.shape[1]
    wide = np.pad(light, ((0, 0), (half, half)))
    total = np.zeros_like(light)
    for first, share in enumerate(shares):
        total += np.float32(share) * wide[:, first : first + columns]
    return total
