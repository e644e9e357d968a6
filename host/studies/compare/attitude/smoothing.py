"""A Kalman filter that smooths the attitudes of successive images.

AraMiS thesis, section 6.2, names it without equations. This is the multiplicative filter (Lefferts,
Markley and Shuster 1982) with the rate as a state in place of a gyroscope: three angles of error,
about the camera's axes, and three rates. QUEST measures; its covariance is the inverse of the
stars' information (Shuster and Oh 1981, equation 105).
"""

from collections.abc import Sequence

import numpy as np

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.attitude.arithmetic import Matrix, inverse, product
from cubestack.host.studies.compare.attitude.methods import QUEST_1

RATE_NOISE = 1e-6  #: rad per s, by which the rate may change in a second (chosen)
FIRST_RATE = 0.005  #: rad per s, standard deviation of the unknown rate at first (chosen)


def smooth(
    frames: Sequence[Matrix], listed: Matrix, sigma_rad: float, step_s: float, meter: Meter
) -> Matrix | None:
    """The attitude (3, 3) at the last of some frames (n, 3), ``step_s`` apart, with the error of a
    direction per axis; None if QUEST solves none of them."""
    attitude: Matrix | None = None
    rate, covariance = np.zeros(3, np.float32), np.zeros((6, 6), np.float32)
    step = np.float32(step_s)
    for measured in frames:
        if attitude is not None:
            attitude, covariance = _predict(attitude, rate, covariance, step, meter)
        seen = QUEST_1.solve(measured, listed, meter)
        noise = _covariance(measured, sigma_rad, meter)
        if seen is None or noise is None:
            continue
        if attitude is None:
            attitude = seen
            covariance[:3, :3] = noise
            covariance[3:, 3:] = np.eye(3, dtype=np.float32) * np.float32(FIRST_RATE**2)
            continue
        gain = inverse(covariance[:3, :3] + noise, meter)
        if gain is None:
            continue
        gain = product(covariance[:, :3], gain, meter)
        error = _angles(product(seen, attitude.T, meter))
        change = product(gain, error[:, None], meter)[:, 0]
        # Joseph's form: in single precision the short one loses what the first rate hides.
        rest = np.eye(6, dtype=np.float32)
        rest[:, :3] -= gain
        covariance = product(product(rest, covariance, meter), rest.T, meter)
        covariance += product(product(gain, noise, meter), gain.T, meter)
        meter.charge(f32_add=9 + 3 + 18 + 36 + 3)
        attitude = product(_turn(change[:3], meter), attitude, meter)
        rate = rate + change[3:]
    return attitude


def _predict(
    attitude: Matrix, rate: Matrix, covariance: Matrix, step: np.float32, meter: Meter
) -> tuple[Matrix, Matrix]:
    turn = _turn(rate * step, meter)
    transition = np.eye(6, dtype=np.float32)
    transition[:3, :3], transition[:3, 3:] = turn, step * np.eye(3, dtype=np.float32)
    covariance = product(product(transition, covariance, meter), transition.T, meter)
    covariance[3:, 3:] += np.eye(3, dtype=np.float32) * (np.float32(RATE_NOISE**2) * step)
    meter.charge(f32_mul=3, f32_add=3)
    return product(turn, attitude, meter), covariance


def _covariance(measured: Matrix, sigma_rad: float, meter: Meter) -> Matrix | None:
    """Of an attitude's error about the camera's axes, rad^2; None where nothing fixes one."""
    count = len(measured)
    information = count * np.eye(3, dtype=np.float32) - measured.T @ measured
    meter.charge(f32_mul=6 * count, f32_add=6 * count + 3, loop=count)
    found = inverse(information, meter)
    return None if found is None else found * np.float32(sigma_rad**2)


def _angles(difference: Matrix) -> Matrix:
    """Small angles (3,) of a rotation of axes."""
    half = np.float32(0.5)
    return half * np.array([
        difference[1, 2] - difference[2, 1],
        difference[2, 0] - difference[0, 2],
        difference[0, 1] - difference[1, 0],
    ])  # fmt: skip


def _turn(angles: Matrix, meter: Meter) -> Matrix:
    """Rotation of axes by small angles (3,): Cayley's form, which is exactly orthogonal."""
    x, y, z = angles / np.float32(2)
    cross = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]], np.float32)
    square = x * x + y * y + z * z
    meter.charge(f32_mul=3 + 6 + 9 + 9, f32_add=2 + 6 + 12, f32_div=1)
    found: Matrix = np.eye(3, dtype=np.float32) + (cross + cross @ cross) * (
        np.float32(2) / (1 + square)
    )
    return found
