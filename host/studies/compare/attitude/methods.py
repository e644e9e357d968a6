"""Attitudes from directions of the same stars in camera and inertial axes.

Each method returns the direction cosine matrix (3, 3), inertial to camera, or None. QUEST is the
devices' own. All weigh all stars alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.attitude.quest import AttitudeError, Eigenvalue, dcm, quest
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.attitude.arithmetic import (
    Matrix,
    cross,
    eigenvectors,
    inverse,
    orthogonal_columns,
    product,
    profile,
    unit,
)
from cubestack.host.studies.compare.tracker import alternatives

Solve = Callable[[Matrix, Matrix, Meter], Matrix | None]
"""Of measured and listed directions (n, 3)."""

STEPS = 6  #: of Newton's iteration to the nearest rotation (chosen)


def triad(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
    """CubeStar thesis, equations 4.4.1 to 4.4.7: the brightest star, taken as exact, and the one
    farthest from it."""
    cosines = measured[1:] @ measured[0]
    meter.charge(f32_mul=3 * len(cosines), f32_add=2 * len(cosines), f32_compare=len(cosines))
    other = 1 + int(cosines.argmin())
    frames = []
    for first, second in ((measured[0], measured[other]), (listed[0], listed[other])):
        across = cross(first, second, meter)
        if not (across * across).sum() > np.finfo(first.dtype).eps ** 2:
            return None
        across = unit(across, meter)
        frames.append(np.stack([first, across, cross(first, across, meter)], axis=1))
    return product(frames[0], frames[1].T, meter)


def q_method(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
    """Davenport: the eigenvector of K with the largest eigenvalue (AraMiS thesis, equations 6.4 to
    6.6), all four found by Jacobi's method."""
    b = profile(measured, listed, meter)
    trace = b[0, 0] + b[1, 1] + b[2, 2]
    z = np.array([b[1, 2] - b[2, 1], b[2, 0] - b[0, 2], b[0, 1] - b[1, 0]])
    k = np.empty((4, 4), b.dtype)
    k[:3, :3] = b + b.T - trace * np.eye(3, dtype=b.dtype)
    k[:3, 3] = k[3, :3] = z
    k[3, 3] = trace
    meter.charge(f32_add=2 + 6 + 3 + 3, ram_read=9, ram_write=16)
    values, vectors = eigenvectors(k, meter)
    meter.charge(f32_compare=3)
    x, y, z, w = vectors[:, int(values.argmax())]
    # Davenport's quaternion turns the axes.
    return _matrix(-x, -y, -z, w, meter)


def svd(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
    """Markley: B = U S V', A = U diag(1, 1, det U det V) V' (named in the CubeStar thesis, section
    4.4). The third columns are products of the first two, so determinants are not needed."""
    left, right = orthogonal_columns(profile(measured, listed, meter), meter)
    if not (left[:, 1] ** 2).sum() > np.finfo(left.dtype).eps ** 2:
        return None
    first, second = unit(left[:, 0], meter), unit(left[:, 1], meter)
    u = np.stack([first, second, cross(first, second, meter)], axis=1)
    v = np.stack([right[:, 0], right[:, 1], cross(right[:, 0], right[:, 1], meter)], axis=1)
    return product(u, v.T, meter)


def plain_dcm(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
    """Least squares for all nine elements (AraMiS thesis, section 6.1.1): A = B R^-1, with R the
    mean of listed times listed. Nothing makes it a rotation, and two stars leave R singular."""
    inverted = inverse(profile(listed, listed, meter), meter)
    return None if inverted is None else product(profile(measured, listed, meter), inverted, meter)


def orthogonal_dcm(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
    """The same, and the rotation nearest to it: A becomes the mean of A and the inverse of A', time
    and again."""
    a = plain_dcm(measured, listed, meter)
    for _ in range(STEPS):
        turned = None if a is None else inverse(a.T, meter)
        if a is None or turned is None:
            return None
        a = (a + turned) / a.dtype.type(2)
        meter.charge(f32_add=9, f32_mul=9, ram_read=18, ram_write=9)
    return a


def printed_quest(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
    """CubeStar thesis, equations 4.4.9 and 4.4.10 as printed, with an eigenvalue of 1: near half
    turns the Rodrigues vector grows without bound."""
    b = profile(measured, listed, meter)
    one = b.dtype.type(1)
    trace = b[0, 0] + b[1, 1] + b[2, 2]
    inverted = inverse((one + trace) * np.eye(3, dtype=b.dtype) - b - b.T, meter)
    meter.charge(f32_add=2 + 1 + 9 + 3 + 3, ram_read=9, ram_write=12)
    if inverted is None:
        return None
    right = np.array([b[1, 2] - b[2, 1], b[2, 0] - b[0, 2], b[0, 1] - b[1, 0]])
    p = product(inverted, right[:, None], meter)[:, 0]
    scale = one / np.sqrt(one + p @ p)
    meter.charge(f32_mul=6, f32_add=3, f32_sqrt=1, f32_div=1)
    x, y, z, w = np.append(p * scale, scale)
    return _matrix(-x, -y, -z, w, meter)


def quest_with(eigenvalue: Eigenvalue | None) -> Solve:
    """The devices' QUEST with an eigenvalue that is found so; None: with 1."""

    def solve(measured: Matrix, listed: Matrix, meter: Meter) -> Matrix | None:
        weights = np.ones(len(measured), np.float32)
        try:
            return dcm(quest(measured, listed, weights, meter, eigenvalue=eigenvalue), meter)
        except AttitudeError:
            return None

    return solve


def _matrix(x: float, y: float, z: float, w: float, meter: Meter) -> Matrix:
    """Of a quaternion that turns vectors, as ``attitude.quest.dcm``, in any precision."""
    meter.charge(f32_mul=19, f32_add=12)
    s = w * w - x * x - y * y - z * z
    return np.array([
        [s + 2 * x * x, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), s + 2 * y * y, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), s + 2 * z * z],
    ])  # fmt: skip


@dataclass(frozen=True)
class Method:
    """A method of the table."""

    name: str
    source: str
    solve: Solve


PRINTED = "QUEST as printed"
QUEST_1 = Method("QUEST, eigenvalue 1", "S 4.4.1, A 6.2", quest_with(None))

_FIRST = (
    Method("TRIAD", "S 4.4.1", triad),
    Method("q-method", "S 4.4.1, A 6.2", q_method),
    Method(PRINTED, "S 4.4.1", printed_quest),
    QUEST_1,
)
_LAST = (
    Method("SVD", "S 4.4.1", svd),
    Method("plain DCM", "A 6.1.1", plain_dcm),
    Method("orthogonal DCM", "A 6.1.1", orthogonal_dcm),
)


def methods() -> Sequence[Method]:
    """All in the order of the tables, with those of the devices' own programs."""
    return (*_FIRST, *(one for offered in alternatives() for one in offered.ATTITUDE), *_LAST)
