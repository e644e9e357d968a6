"""Pictures of drawn stars whose places are known."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from cubestack.firmware_model.cubestar.detection import Detection

Picture = NDArray[np.uint8]
Places = NDArray[np.float64]


def spots(places: Places, light: NDArray[np.float64], sigma: float = 0.9) -> NDArray[np.float64]:
    """A full picture in DN with the light of each star integrated over the pixels."""
    image = np.zeros((512, 1024))
    for (x, y), total in zip(places, light, strict=True):
        top, left = max(int(y) - 12, 0), max(int(x) - 12, 0)
        rows, columns = np.arange(top, min(top + 25, 512)), np.arange(left, min(left + 25, 1024))
        edge = sigma * np.sqrt(2)
        down, across = (
            erf((cells - middle + 0.5) / edge) - erf((cells - middle - 0.5) / edge)
            for cells, middle in ((rows, y), (columns, x))
        )
        image[top : top + 25, left : left + 25] += total / 4 * down[:, None] * across
    return image


def taken(image: NDArray[np.float64]) -> Picture:
    """The image of an 8-bit camera."""
    picture: Picture = np.clip(np.floor(image), 0, 255).astype(np.uint8)
    return picture


def drawn(
    kind: str, rng: np.random.Generator, count: int = 18, background: float = 0.0
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """A full picture with stars on a jittered grid, and their true x, y in scan order."""
    places = np.array([(60 + 110 * c, 80 + 170 * r) for r in range(3) for c in range(9)])[:count]
    true = places + rng.uniform(-20, 20, (count, 2))
    image = np.zeros((512, 1024))
    y, x = np.mgrid[0:512, 0:1024]
    for tx, ty in true:
        window = np.s_[int(ty) - 8 : int(ty) + 9, int(tx) - 8 : int(tx) + 9]
        wy, wx = y[window] - ty, x[window] - tx
        if kind == "sampled":  # thesis section 4.1.6, sigma 1 px, 255 at the centre
            image[window] += 255 * np.exp(-(wx**2 + wy**2) / 2)
        elif kind == "sampled in 5 x 5":
            near = (np.abs(np.rint(tx) - x[window]) <= 2) & (np.abs(np.rint(ty) - y[window]) <= 2)
            image[window] += 255 * np.exp(-(wx**2 + wy**2) / 2) * near
        else:  # light integrated over each pixel, sigma 0.9 px, V 1 to 3.8
            light = 300 * 10 ** (0.4 * rng.uniform(0, 2.8))
            edge = 0.9 * np.sqrt(2)
            image[window] += (
                light
                / 4
                * (erf((wx + 0.5) / edge) - erf((wx - 0.5) / edge))
                * (erf((wy + 0.5) / edge) - erf((wy - 0.5) / edge))
            )
    image += background * (1 + 0.5 * np.sin(x / 150) * np.cos(y / 100))
    return np.clip(np.floor(image), 0, 255).astype(np.uint8), true


def errors(found: Detection, true: NDArray[np.float64]) -> NDArray[np.float64]:
    nearest = [np.argmin(np.hypot(*(true - place).T)) for place in found.centroids]
    assert len(set(nearest)) == len(nearest)
    return np.asarray(found.centroids - true[nearest], dtype=np.float64)
