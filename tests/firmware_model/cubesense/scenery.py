"""Pictures of the Earth and the Sun through equation 5.2.3, drawn in double precision."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cubestack.firmware_model.cubesense.download import frame_pixels
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig, EdgeList, NadirLines
from cubestack.firmware_model.interface.cubesense.codes import ImageSize
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, SUN_NOT_FOUND, ReadOut
from cubestack.firmware_model.mcu.costs import Meter

COLUMNS, ROWS = FULL_SIZE.columns, FULL_SIZE.rows
NADIR_BORESIGHT, SUN_BORESIGHT = (371.0, 236.0), (369.0, 250.0)
PX_PER_DEG, FIELD_DEG = 2.9, 95.0
BACKGROUND, EARTH_LEVEL = 34.0, 153.0
EARTH_RADIUS_KM = 6378.136
#: The Sun's spot: 99 is its edge; its sigma makes 8 px on the boresight shrink to 6 px at the rim.
SPOT_EDGE, SPOT_SIGMA = 99.0 - BACKGROUND, 0.367
FINE = 6  # samples of a pixel on the limb, each way

_DENSE = np.linspace(0, 340, 200_001)


def distort(radius: NDArray[np.float64] | float) -> NDArray[np.float64]:
    return np.asarray(np.polyval([-2.5572e-6, 7.6076e-5, 0.9953, 0.1036], radius))


_DISTORTED = distort(_DENSE)


def undistort(radius: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Inverse of ``distort``, out of a dense table of it; 0 below its smallest value."""
    return np.interp(radius, _DISTORTED, _DENSE)


def directions(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (..., 3) of offsets from the boresight in px."""
    phi = np.arctan2(y, x)
    theta = np.radians(undistort(np.hypot(x, y)) / PX_PER_DEG)
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )


def direction(alpha_deg: float, beta_deg: float) -> NDArray[np.float64]:
    theta, phi = np.radians(np.hypot(alpha_deg, beta_deg)), np.arctan2(beta_deg, alpha_deg)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def place(alpha_deg: float, beta_deg: float, boresight: tuple[float, float]) -> NDArray[np.float64]:
    """Where a direction is in the picture, px."""
    theta = np.hypot(alpha_deg, beta_deg)
    stretch = distort(PX_PER_DEG * theta) / theta if theta else 0.0
    return np.array(boresight) + stretch * np.array([alpha_deg, beta_deg])


def error_deg(
    measured: tuple[float, float] | NDArray[np.float64], true: tuple[float, float]
) -> float:
    """Angle between two directions, each (alpha, beta)."""
    cosine = direction(*measured) @ direction(*true)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def angular_radius_deg(altitude_km: float) -> float:
    return float(np.degrees(np.arcsin(EARTH_RADIUS_KM / (EARTH_RADIUS_KM + altitude_km))))


@lru_cache(maxsize=2)
def _field(boresight: tuple[float, float]) -> tuple[NDArray[np.float64], ...]:
    """Offsets from the boresight (rows, columns, 2), their lengths, and unit vectors."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    offsets = np.stack([columns - boresight[0], rows - boresight[1]], axis=-1)
    x, y = offsets[..., 0], offsets[..., 1]
    return offsets, np.hypot(x, y), directions(x, y)


def earth(
    alpha_deg: float,
    beta_deg: float,
    altitude_km: float = 750.0,
    rng: np.random.Generator | None = None,
    boresight: tuple[float, float] = NADIR_BORESIGHT,
    level: float = EARTH_LEVEL,
) -> NDArray[np.uint8]:
    """An even Earth; pixels on its limb and on the rim of the field get the share they see."""
    share = _earth_share(alpha_deg, beta_deg, altitude_km, boresight)
    return _digital(BACKGROUND + (level - BACKGROUND) * share, rng)


@lru_cache(maxsize=32)
def _earth_share(
    alpha_deg: float, beta_deg: float, altitude_km: float, boresight: tuple[float, float]
) -> NDArray[np.float64]:
    """Of each pixel, the part that the Earth covers."""
    offsets, radius, vectors = _field(boresight)
    towards = direction(alpha_deg, beta_deg)
    limit = np.cos(np.radians(angular_radius_deg(altitude_km)))
    rim = float(distort(FIELD_DEG * PX_PER_DEG))
    inside = (vectors @ towards >= limit) & (radius <= rim)
    unsure = ndimage.maximum_filter(inside, 3) & ~ndimage.minimum_filter(inside, 3)
    fine = (np.arange(FINE) + 0.5) / FINE - 0.5
    x = offsets[unsure][:, 0, None, None] + fine[None, None, :]
    y = offsets[unsure][:, 1, None, None] + fine[None, :, None]
    x, y = np.broadcast_arrays(x, y)
    seen = (directions(x, y) @ towards >= limit) & (np.hypot(x, y) <= rim)
    share = inside.astype(float)
    share[unsure] = seen.mean(axis=(1, 2))
    return share


def sun(
    centre: NDArray[np.float64],
    bloom_px: float,
    rng: np.random.Generator | None = None,
    *,
    flat: bool = False,
) -> NDArray[np.uint8]:
    """A spot that falls to 30 % of full scale at ``bloom_px``, or a saturated even disc.

    Only its surroundings have noise.
    """
    left, top = (max(0, int(at) - 40) for at in centre)
    rows, columns = np.mgrid[top : min(top + 80, ROWS), left : min(left + 80, COLUMNS)]
    distance = np.hypot(columns - centre[0], rows - centre[1])
    if flat:
        light = 255 * np.clip(bloom_px + 0.5 - distance, 0, 1)
    else:
        peak = SPOT_EDGE * np.exp(1 / (2 * SPOT_SIGMA**2))
        light = peak * np.exp(-((distance / (SPOT_SIGMA * bloom_px)) ** 2) / 2)
    picture = np.full((ROWS, COLUMNS), BACKGROUND, np.uint8)
    picture[rows, columns] = _digital(BACKGROUND + light, rng)
    return picture


def chequered() -> NDArray[np.uint8]:
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    return np.where((rows // 64 + columns // 64) % 2, 200, 0).astype(np.uint8)


def rough(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Squares of 40 pixels, dark and bright, with so much noise that their values overlap."""
    picture = rng.integers(0, 90, (ROWS, COLUMNS)).astype(np.uint8)
    picture[rng.integers(0, 2, (ROWS // 40, COLUMNS // 40)).repeat(40, 0).repeat(40, 1) > 0] += 60
    return picture


def _digital(light: NDArray[np.float64], rng: np.random.Generator | None) -> NDArray[np.uint8]:
    if rng is not None:
        light = light + rng.normal(0, 1, light.shape)
    return np.clip(light + 0.5, 0, 255).astype(np.uint8)


@lru_cache(maxsize=64)
def _scan_order(read_out: ReadOut) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    # Beyond the picture a memory holds anything; here the first row's end.
    at = [None if a is None else (min(a[0], read_out.columns - 1), a[1]) for a in read_out.scan()]
    flat = np.array(
        [0 if pixel is None else pixel[1] * read_out.columns + pixel[0] for pixel in at]
    )
    return flat, np.array([pixel is not None for pixel in at])


def scan(picture: NDArray[np.uint8], read_out: ReadOut = FULL_SIZE) -> NDArray[np.uint8]:
    flat, presented = _scan_order(read_out)
    return np.where(presented, picture.reshape(-1)[flat], 0).astype(np.uint8)


def window(picture: NDArray[np.uint8], threshold: int = 200) -> NDArray[np.uint8]:
    """The bytes of the window read-out: the first of three pixels in a row, and the square."""
    bright = picture >= threshold
    runs = bright[:, :-2] & bright[:, 1:-1] & bright[:, 2:]
    found = np.flatnonzero(runs)
    if len(found):
        y, x = divmod(int(found[0]), COLUMNS - 2)
    else:
        x, y = SUN_NOT_FOUND
    left = min(max(x - 5, 0), COLUMNS - 15)
    top = min(max(y - 3, 0), ROWS - 15)
    coordinates = np.array([x & 255, x >> 8, y & 255, y >> 8], np.uint8)
    return np.concatenate([coordinates, picture[top : top + 15, left : left + 15].reshape(-1)])


def edges_in(
    picture: NDArray[np.uint8],
    meter: Meter,
    config: EdgeConfig | None = None,
    read_out: ReadOut = FULL_SIZE,
) -> EdgeList:
    lines, data = NadirLines(config or EdgeConfig(), meter, read_out), scan(picture, read_out)
    for size in iter(lambda: lines.wanted, 0):
        lines.space[:], data = data[:size], data[size:]
        lines.filled()
    assert not len(data)
    return lines.edges


def thumbnail(picture: NDArray[np.uint8], size: ImageSize) -> NDArray[np.uint8]:
    """The whole square (side, side) of ``picture`` (480, 640), as its frames carry it."""
    pixels = np.concatenate([frame_pixels(size, frame) for frame in range(size.frames)])
    padded = np.append(picture.ravel(), np.uint8(0))  # OUTSIDE counts as its last element
    return padded[pixels].reshape(size.side, size.side)
