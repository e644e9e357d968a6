"""A camera's parameters from identified stars in any number of images.

CubeStar thesis, section 5.4: the focal length from the distances of star pairs near the middle
(equation 5.4.1); principal point and distortion there from a second lens and a checker board. Here
all parameters come from the stars, with each picture's attitude, by least squares (Gauss, Newton).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cubestack.host.calibration.camera import Camera

Points = NDArray[np.float64]

#: All parameters, in the order of `Camera`'s fields.
PARAMETERS = tuple(field.name for field in fields(Camera))

LEAST_STARS = 5
"""Minimum number of identified stars in an image: with fewer, the identification may be wrong."""

LEAST_PICTURES = 3
AGREEMENT_PX = 20.0
"""Largest error of the first camera between two stars."""

STEPS = 50
HALVINGS = 12
CONVERGED = 1e-9
OUTLIER = 5.0
"""Outlier limit in deviations; the deviation is 1.48 medians."""

LEAST_OUTLIER_PX = 0.2
ROUNDS = 5
MIDDLE_PX = 250.0
"""Largest distance from the principal point of stars in pairs: the distortion is small there."""

_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Sight:
    """The identified stars of one image.

    Attributes:
        pixels: centroids (n, 2), column and row.
        vectors: inertial unit vectors (n, 3) by the catalogue.
    """

    pixels: Points
    vectors: Points


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit."""

    camera: Camera  #: the parameters
    pictures: int  #: number of images used
    sigma: dict[str, float]  #: standard deviations of the parameters by name; fixed ones have none
    #: focal length from star pairs alone; None without a pair near the middle
    pairs_f_px: float | None
    #: before_px, after_px: root mean square residual of the first and of the fitted camera, each
    #: image at its best attitude
    before_px: float
    after_px: float
    #: places, residuals: (n, 2) px: positions of the stars used, and measured minus predicted
    places: Points
    residuals: Points
    rejected: int  #: number of stars left out, with those of unusable images


def fit_camera(
    sights: Sequence[Sight], guess: Camera, free: Sequence[str] = PARAMETERS, *, exact: bool = False
) -> Fit:
    """Fit the ``free`` parameters of ``guess`` to stars.

    Stars that agree with few others of their image are rejected first, as misidentified, and later
    outliers of the fit. With ``exact`` stars none are rejected, and one image is enough.

    Raises ValueError for too few images with enough stars, or if the fit fails.
    """
    agreed = sights if exact else [_agreeing(sight, guess) for sight in sights]
    usable = [sight for sight in agreed if len(sight.pixels) >= LEAST_STARS]
    least = 1 if exact else LEAST_PICTURES
    if len(usable) < least:
        raise ValueError(
            f"a calibration needs {least} pictures with {LEAST_STARS} identified stars or "
            f"more; of {len(sights)} pictures {len(usable)} have them"
        )
    first = _Problem(usable, guess, ())
    first.solve()
    problem = _Problem(usable, guess, free)
    for _ in range(ROUNDS):
        covariance = problem.solve()
        if exact or not problem.reject():
            break
    residuals = problem.residuals()[problem.kept]
    variance = float((residuals**2).sum()) / max(1, residuals.size - len(covariance))
    sigma = np.sqrt(np.diag(covariance)[: len(free)] * variance)
    return Fit(
        problem.camera,
        len(usable),
        dict(zip(free, sigma.tolist(), strict=True)),
        focal_by_pairs(usable, problem.camera),
        _rms(first.residuals()[problem.kept]),
        _rms(residuals),
        problem.pixels[problem.kept],
        residuals,
        sum(len(sight.pixels) for sight in sights) - int(problem.kept.sum()),
    )


def focal_by_pairs(sights: Sequence[Sight], camera: Camera) -> float | None:
    """Mean of equation 5.4.1 over pairs of stars near the principal point, px.

    It uses the tangent for the angle, since pixels lie in a plane.
    """
    found = []
    for sight in sights:
        offsets = sight.pixels - (camera.cx_px, camera.cy_px)
        near = np.flatnonzero(np.hypot(*offsets.T) < MIDDLE_PX)
        for one, other in combinations(near, 2):
            angle = np.arccos(np.clip(sight.vectors[one] @ sight.vectors[other], -1, 1))
            found.append(np.linalg.norm(offsets[one] - offsets[other]) / (2 * np.tan(angle / 2)))
    return float(np.mean(found)) if found else None


def _agreeing(sight: Sight, camera: Camera) -> Sight:
    """The largest group of an image's stars that agree with the attitude from two of them."""
    seen = _directions(camera, sight.pixels)
    best = np.zeros(len(seen), bool)
    for pair in combinations(range(len(seen)), 2):
        body = sight.vectors @ _rotation(seen[[*pair]], sight.vectors[[*pair]]).T
        agrees = np.linalg.norm(body - seen, axis=1) < AGREEMENT_PX / camera.f_px
        if agrees.sum() > best.sum():
            best = agrees
    return Sight(sight.pixels[best], sight.vectors[best])


def _directions(camera: Camera, pixels: Points) -> Points:
    """Unit vectors (n, 3) in camera axes."""
    plane = camera.unproject(pixels) if len(pixels) else np.empty((0, 2))
    seen = np.concatenate([plane, np.ones((len(plane), 1))], axis=1)
    return np.asarray(seen / np.linalg.norm(seen, axis=1, keepdims=True))


def _rotation(seen: Points, vectors: Points) -> Points:
    """Rotation (3, 3), inertial to camera, that fits directions best (Markley's SVD)."""
    u, _, vt = np.linalg.svd(seen.T @ vectors)
    return np.asarray(u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(vt)]) @ vt)


class _Problem:
    """Free parameters of a camera and three of each picture's attitude, by Gauss-Newton.

    Attributes:
        camera: the current fit.
        pixels: all stars (n, 2), picture by picture.
        kept: (n,) stars in use.
    """

    def __init__(self, sights: Sequence[Sight], camera: Camera, free: Sequence[str]) -> None:
        self.camera = camera
        self._free = free
        self.pixels = np.concatenate([sight.pixels for sight in sights])
        self._vectors = np.concatenate([sight.vectors for sight in sights])
        self._of = np.repeat(np.arange(len(sights)), [len(sight.pixels) for sight in sights])
        self._attitudes = np.array(
            [_rotation(_directions(camera, sight.pixels), sight.vectors) for sight in sights]
        )
        self.kept = np.ones(len(self.pixels), bool)

    def residuals(self) -> Points:
        """Measured minus predicted positions (n, 2) of all stars in px."""
        return self.pixels - _project(self.camera, self._body())

    def solve(self) -> Points:
        """Iterate to the minimum; returns the covariance for unit variance, camera first."""
        cost = self._cost()
        for _ in range(STEPS):
            jacobian = self._jacobian()
            step = np.asarray(
                np.linalg.lstsq(jacobian, self._kept_residuals(), rcond=None)[0], np.float64
            )
            before, length = (self.camera, self._attitudes), 1.0
            for _ in range(HALVINGS):
                self._move(step * length)
                if (now := self._cost()) <= cost:
                    break
                (self.camera, self._attitudes), length = before, length / 2
            else:
                break
            done, cost = cost - now <= CONVERGED * cost, now
            if done:
                break
        if not np.isfinite(cost):
            raise ValueError("no camera fits these stars: a better --camera guess may help")
        jacobian = self._jacobian()
        return np.asarray(np.linalg.pinv(jacobian.T @ jacobian))

    def reject(self) -> bool:
        """Reject outliers; returns whether that changed anything."""
        distance = np.hypot(*self.residuals().T)
        limit = OUTLIER * 1.4826 * float(np.median(distance[self.kept]))
        kept = distance <= max(limit, LEAST_OUTLIER_PX)
        changed = not np.array_equal(kept, self.kept)
        self.kept = kept
        return changed

    def _body(self) -> Points:
        return np.asarray(np.einsum("nij,nj->ni", self._attitudes[self._of], self._vectors))

    def _kept_residuals(self) -> Points:
        return self.residuals()[self.kept].ravel()

    def _cost(self) -> float:
        found = self._kept_residuals()
        return float(found @ found)

    def _jacobian(self) -> Points:
        """Jacobian of the kept stars' positions (2 n, parameters)."""
        body, kept = self._body(), self.kept
        places = _project(self.camera, body)
        own = len(self._free)
        result = np.zeros((len(body), 2, own + 3 * len(self._attitudes)))
        for column, name in enumerate(self._free):
            step = _STEP * max(1.0, abs(getattr(self.camera, name)))
            moved = replace(self.camera, **{name: getattr(self.camera, name) + step})
            result[:, :, column] = (_project(moved, body) - places) / step
        rows = np.arange(len(body))
        for axis in range(3):
            turned = body + _STEP * np.cross(np.eye(3)[axis], body)
            result[rows, :, own + 3 * self._of + axis] = (
                _project(self.camera, turned) - places
            ) / _STEP
        return result[kept].reshape(-1, result.shape[2])

    def _move(self, step: Points) -> None:
        own = len(self._free)
        values = {name: getattr(self.camera, name) for name in self._free}
        moved = {name: values[name] + float(by) for name, by in zip(values, step, strict=False)}
        self.camera = replace(self.camera, **moved)
        turns = step[own:].reshape(-1, 3)
        self._attitudes = np.array(
            [_turn(by) @ old for by, old in zip(turns, self._attitudes, strict=True)]
        )


def _turn(vector: Points) -> Points:
    """Rotation matrix (3, 3) of a rotation vector (3,), rad."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / (angle or 1.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def _project(camera: Camera, body: Points) -> Points:
    with np.errstate(divide="ignore", invalid="ignore"):
        return camera.project(body[:, :2] / body[:, 2:])


def _rms(residuals: Points) -> float:
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))
