"""Which bright spots are stars, and where exactly: shape tests and weighted centroids.

A centroid is the place about which the signal, weighed with a Gaussian of the spot's own width,
balances: unbiased where a window cuts the spot, and as accurate as a fit of the spot. The program
works in whole numbers with a table of weights; only the last division is in floating point.

Expected errors: Cramer-Rao bounds of a Gaussian spot of width s and light F. Noise n in each pixel
makes n s^2 sqrt(8 pi) / F, the light's own noise s / sqrt(electrons).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter

HALF = 4
"""Windows reach so many pixels to each side of the brightest one."""

SPOT_SIGMA_PX = 0.9
WIDE_SIGMA_PX = 1.8
"""Widths of the weights: of a star's spot; of a saturated one's, whose middle is flat."""

SATURATED_DN = 250
ROUNDS = 4
SHARPEST = 0.6
"""Largest share of the brightest pixel in the 3 x 3 around it: 0.22 in a spot of sigma 0.9 px, 0.54
in one of 0.45 px, and more in what particles and hot pixels leave; chosen."""

ELECTRONS_PER_DN = 36.5
"""MLX75412: 2.28 electrons per count of 12 bits, whose upper 8 are here."""

LEAST_ERROR_PX = 0.01
SATURATED_ERROR_PX = 0.04
"""What uneven pixels leave of bright stars, and a flat middle besides: measured, with a margin."""

_PARTS = 64
"""Of a pixel: places between which the weights are tabulated."""

_LARGEST = 255

Windows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Spots:
    """Places (n, 2) x and y from the windows' middles, light in DN and expected errors in px."""

    places: NDArray[np.float32]
    light: NDArray[np.float32]
    errors: NDArray[np.float32]


def too_sharp(windows: Windows, noises: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which windows' middles are sharper than a spot; signal (n, 9, 9) and noise in 1/16 DN."""
    near = windows[:, HALF - 1 : HALF + 2, HALF - 1 : HALF + 2].sum(axis=(1, 2))
    sharp: NDArray[np.bool_] = windows[:, HALF, HALF] - noises > SHARPEST * near
    return sharp


def _weights(distances: Windows, wide: NDArray[np.bool_]) -> Windows:
    """Tabulated weights of ``distances`` (n, 9) in 1/64 px."""
    sigma = np.where(wide, WIDE_SIGMA_PX, SPOT_SIGMA_PX)[:, None]
    weights: Windows = np.rint(_LARGEST * np.exp(-((distances / _PARTS / sigma) ** 2) / 2)).astype(
        np.int64
    )
    return weights


def centre(
    windows: Windows,
    starts: NDArray[np.float64],
    saturated: NDArray[np.bool_],
    noises: NDArray[np.int64],
    meter: Meter,
) -> Spots:
    """Centroids of ``windows``: signal (n, 9, 9) in 1/16 DN, looked for from ``starts`` (n, 2)."""
    cells = _PARTS * np.arange(-HALF, HALF + 1)
    at = np.rint(np.clip(starts, -1.5, 1.5) * _PARTS).astype(np.int64)
    for turn in range(ROUNDS):
        across, down = (cells - at[:, axis, None] for axis in (0, 1))
        wx, wy = _weights(across, saturated), _weights(down, saturated)
        by_row = (windows * wx[:, None, :]).sum(axis=2)
        total = np.maximum((by_row * wy).sum(axis=1), 1)
        sum_x = (((windows * (wx * across)[:, None, :]).sum(axis=2)) * wy).sum(axis=1)
        sum_y = (by_row * wy * down).sum(axis=1)
        # A Gaussian in its own weights moves by half of what is missing; a wider weight by more.
        gain = np.where(saturated, 1.25, 2.0)[:, None]
        step = gain * np.stack([sum_x, sum_y], axis=1) / total[:, None]
        if turn < ROUNDS - 1:
            at = np.clip(at + np.rint(step).astype(np.int64), -2 * _PARTS, 2 * _PARTS)
    places = np.clip((at + step) / _PARTS, -2.5, 2.5)
    light = np.maximum(windows.sum(axis=(1, 2)) / 16, 1)
    noise = noises / 16
    errors = np.sqrt(
        (noise * SPOT_SIGMA_PX**2 * np.sqrt(8 * np.pi) / light) ** 2
        + SPOT_SIGMA_PX**2 / (ELECTRONS_PER_DN * light)
        + np.where(saturated, SATURATED_ERROR_PX, LEAST_ERROR_PX) ** 2
    )
    pixels = ROUNDS * len(windows) * (2 * HALF + 1) ** 2
    meter.charge(ram_read=2 * pixels, i32_mul=2 * pixels, i32_add=3 * pixels, loop=pixels)
    meter.charge(
        i32_div=2 * ROUNDS * len(windows),
        f32_convert=6 * len(windows),
        f32_div=5 * len(windows),
        f32_add=5 * len(windows),
        f32_mul=5 * len(windows),
        f32_sqrt=len(windows),
    )
    return Spots(places.astype(np.float32), light.astype(np.float32), errors.astype(np.float32))
