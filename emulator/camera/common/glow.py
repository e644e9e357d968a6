"""Extended light of hazards: surface brightness on the sensor's pixels.

Smooth brightness is evaluated every 16 px and interpolated. Where a hazard declares that it is not
smooth, it is evaluated at each pixel, and then blurred by the lens' spot. A glow is computed for
the middle row: this neglects its shift between the first and the last row of a rolling shutter.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.scene.hazards.contract import CameraState, SkyHazard, angles_rad

CELL_PX = 16
Values = NDArray[np.float32]


def glow_electrons(
    hazards: Sequence[SkyHazard], instants: Sequence[CameraState], optics: Optics
) -> Values | None:
    """Mean electrons per second in each pixel (rows, columns) over ``instants``, or None."""
    all_maps = [_brightness_map(hazards, now, optics) for now in instants]
    maps = [one for one in all_maps if one is not None]
    if not maps:
        return None
    total = sum(maps[1:], start=maps[0])
    return np.asarray(total * (_field(optics)[1] * np.float32(1 / len(all_maps))), np.float32)


def brightness(
    hazards: Sequence[SkyHazard], now: CameraState, vectors: NDArray[np.float64]
) -> Values | None:
    """Surface brightness (n,) of all hazards along ``vectors`` (n, 3) in the scene's axes.

    Unit: V = 0 stars per steradian; None if no hazard glows.
    """
    glows = [(hazard, hazard.glow(now, vectors)) for hazard in hazards]
    if all(glow is None for _, glow in glows):
        return None
    covers = [(hazard.depth, hazard.hidden(now, vectors)) for hazard in hazards]
    total = np.zeros(len(vectors), np.float32)
    for hazard, glow in glows:
        if glow is None:
            continue
        for depth, hidden in covers:
            if hidden is not None and depth > hazard.depth:
                glow = np.where(hidden, np.float32(0), glow)
        total += glow
    return total


def _brightness_map(
    hazards: Sequence[SkyHazard], now: CameraState, optics: Optics
) -> Values | None:
    (x, y), nodes = _grid(optics)
    directions = nodes @ now.axes
    coarse = brightness(hazards, now, directions)
    if coarse is None:
        return None
    down, across = _interpolation_weights(optics.rows, y), _interpolation_weights(optics.columns, x)
    image = np.asarray(down @ coarse.reshape(len(y), len(x)) @ across.T, np.float32)
    fine = _is_steep(hazards, now, directions.reshape(len(y), len(x), 3))
    if not fine.any():
        return image
    rows = np.minimum(np.searchsorted(y, np.arange(optics.rows), "right"), len(y) - 1) - 1
    columns = np.minimum(np.searchsorted(x, np.arange(optics.columns), "right"), len(x) - 1) - 1
    places = np.flatnonzero(fine[rows][:, columns])
    exact = _field(optics)[0][places].astype(np.float64) @ now.axes
    image.ravel()[places] = brightness(hazards, now, exact)
    _blur(image, places, optics.psf_sigma_px)
    return image


def _is_steep(
    hazards: Sequence[SkyHazard], now: CameraState, nodes: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Cells (ny-1, nx-1) of the grid of ``nodes`` (ny, nx, 3) that need all their pixels."""
    cell = np.linalg.norm(nodes[1:, 1:] - nodes[:-1, :-1], axis=2)
    fine = np.zeros(cell.shape, bool)
    for hazard in hazards:
        for ring in hazard.rings(now):
            # Measured from a corner of the cell, whose points are at most a diagonal away.
            angle = angles_rad(nodes[:-1, :-1], ring.centre)
            fine |= (angle < ring.outer_rad + 1.1 * cell) & (angle > ring.inner_rad - 1.1 * cell)
    return fine


def _blur(image: Values, places: NDArray[np.int64], sigma_px: float) -> None:
    half = math.ceil(4 * sigma_px)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma_px) ** 2)
    kernel = (kernel / kernel.sum()).astype(np.float32)
    rows, columns = np.divmod(places, image.shape[1])
    part = image[
        max(0, rows.min() - half) : rows.max() + half + 1,
        max(0, columns.min() - half) : columns.max() + half + 1,
    ]
    for axis in (0, 1):
        pad = [(half, half) if a == axis else (0, 0) for a in (0, 1)]
        wide = np.moveaxis(np.pad(part, pad, "edge"), axis, 0)
        size = part.shape[axis]
        blurred = sum(w * wide[i : i + size] for i, w in enumerate(kernel))
        part[:] = np.moveaxis(np.asarray(blurred), 0, axis)


@lru_cache(maxsize=4)
def _grid(
    optics: Optics,
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]:
    """Columns (nx,) and rows (ny,) of the grid, and its directions (ny * nx, 3) in camera axes."""
    x, y = (
        np.linspace(0, size - 1, math.ceil((size - 1) / CELL_PX) + 1)
        for size in (optics.columns, optics.rows)
    )
    across, down = np.meshgrid(x, y)
    return (x, y), optics.unproject(np.stack([across.ravel(), down.ravel()], axis=1))


def _interpolation_weights(size: int, nodes: NDArray[np.float64]) -> Values:
    """Weights (size, len(nodes)) for linear interpolation between ``nodes``."""
    step = nodes[1] - nodes[0]
    weights = np.maximum(1 - np.abs(np.arange(size)[:, None] - nodes) / step, 0)
    return np.asarray(weights, np.float32)


@lru_cache(maxsize=2)
def _field(optics: Optics) -> tuple[Values, Values]:
    """Each pixel's direction (rows * columns, 3), and electrons per second (rows, columns).

    The electrons are for a brightness of one V = 0 star per steradian; the solid angle of a pixel
    decreases towards the corners.
    """
    y, x = np.mgrid[: optics.rows, : optics.columns].astype(np.float64)
    directions = optics.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
    (xs, ys), _ = _grid(optics)
    gx, gy = (a.ravel() for a in np.meshgrid(xs, ys))
    right, left, below, above = (
        optics.unproject(np.stack([gx + dx, gy + dy], axis=1))
        for dx, dy in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5))
    )
    solid = np.linalg.norm(np.cross(right - left, below - above), axis=1)
    smooth = (
        _interpolation_weights(optics.rows, ys)
        @ solid.reshape(len(ys), len(xs))
        @ _interpolation_weights(optics.columns, xs).T
    )
    electrons = smooth * optics.electrons_per_second(0.0) * optics.even_light
    return directions.astype(np.float32), electrons.astype(np.float32)
