"""Random skies and ideal pictures of them, drawn in double precision."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue


@dataclass
class Shot:
    """The image of a perfect pinhole with CubeStar's field, and the truth."""

    directions: NDArray[np.float32]
    stars: NDArray[np.int64]
    attitude: NDArray[np.float64]


@pytest.fixture(scope="session")
def catalogue() -> StarCatalogue:
    rng = np.random.default_rng(2024)
    vectors = rng.normal(size=(405, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    hip = rng.permutation(100_000)[:405] + 1
    return StarCatalogue.build(hip, vectors, rng.uniform(0, 3.7, 405), 3.8, 57.3)


@pytest.fixture(scope="session")
def shoot(catalogue: StarCatalogue) -> Callable[..., Shot]:
    def take(
        rng: np.random.Generator,
        attitude: NDArray[np.float64] | None = None,
        noise_rad: float = 9e-5,
        false_stars: int = 0,
        most: int = 20,
    ) -> Shot:
        turn = Rotation.random(random_state=rng).as_matrix() if attitude is None else attitude
        body = catalogue.vectors.astype(np.float64) @ turn.T
        forward = body[:, 2] > 0.5
        plane = np.full((len(body), 2), 9.0)
        plane[forward] = body[forward, :2] / body[forward, 2:]
        half = np.array([512, 256]) * 0.0056 / 6.28
        seen = np.flatnonzero(np.all(np.abs(plane) < half, axis=1))
        points = plane[seen] + rng.normal(0, noise_rad, (len(seen), 2))
        points = np.concatenate([points, rng.uniform(-half, half, (false_stars, 2))])
        stars = np.concatenate([seen, np.full(false_stars, -1)])
        order = rng.permutation(len(stars))[:most]
        rays = np.column_stack([points[order], np.ones(len(order))])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return Shot(rays.astype(np.float32), stars[order], turn)

    return take
