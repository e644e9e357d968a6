"""The largest eigenvalue that QUEST needs, from the characteristic quartic.

AraMiS thesis, section 6.2 (equation 6.8), in single precision: Newton's method from 1. The printed
constant term is corrected to ab + cs - d.

In a narrow field the two largest roots are so close that rounding of the coefficients would move
the root by more than the noise of the directions, and the attitude by degrees. So a value of the
quartic within `ROUNDING` counts as 0. With matching stars the root remains 1, as in Shuster's
shortcut; with contradicting ones it moves.
"""

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.mcu.costs import Meter

MOST_STEPS = 10
#: The largest value at 1 seen among 20 000 exact sets of 3 to 11 stars is 1.8e-7.
ROUNDING = np.float32(5e-7)

_ZERO, _ONE, _TWO, _FOUR = (np.float32(value) for value in (0, 1, 2, 4))


def quartic(profile: Floats, meter: Meter) -> tuple[np.float32, np.float32, np.float32]:
    """Coefficients of the square, the linear and the constant term of equation 6.8."""
    matrix = profile + profile.T
    trace = profile[0, 0] + profile[1, 1] + profile[2, 2]
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrix
    z0 = profile[1, 2] - profile[2, 1]
    z1 = profile[2, 0] - profile[0, 2]
    z2 = profile[0, 1] - profile[1, 0]
    minor_x, minor_y, minor_z = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    determinant = xx * minor_x - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    s0, s1, s2 = (row[0] * z0 + row[1] * z1 + row[2] * z2 for row in matrix)
    a = trace * trace - (minor_x + minor_y + minor_z)
    b = trace * trace + z0 * z0 + z1 * z1 + z2 * z2
    c = determinant + z0 * s0 + z1 * s1 + z2 * s2
    d = s0 * s0 + s1 * s1 + s2 * s2
    meter.charge(f32_add=11 + 3 + 4 + 6 + 12 + 2 + 1, f32_mul=6 + 7 + 9 + 1 + 3 + 3 + 3 + 2)
    return -(a + b), -c, a * b + c * trace - d


def largest_eigenvalue(profile: Floats, meter: Meter) -> np.float32:
    """Root of the quartic next to 1, for a profile (3, 3) of weights that add up to 1."""
    square, linear, constant = quartic(profile, meter)
    root = _ONE
    for _ in range(MOST_STEPS):
        value = ((root * root + square) * root + linear) * root + constant
        if abs(value) <= ROUNDING:
            break
        slope = (_FOUR * root * root + _TWO * square) * root + linear
        meter.charge(f32_mul=7, f32_add=5, f32_div=1, f32_compare=2, loop=1)
        if slope <= _ZERO:
            break
        root -= value / slope
    return min(root, _ONE)
