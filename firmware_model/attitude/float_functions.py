"""Arc cosine, arc tangent, sine and cosine in plain single-precision operations.

Libraries differ in the last bit, and one library from machine to machine: NumPy has an arc cosine
for each vector unit. These are sequences of additions, multiplications, divisions and square roots,
each rounded as IEEE 754 says, so the part's program (``firmware_model/reference/algorithms/
float_functions.c``, the same sequences) has the same bits as this one, wherever either runs.

The polynomials are minimax fits, made for this, of the function's remainder after its first term;
results are within 3 units of the last place. Arguments and results are float32 scalars or
arrays.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

_F = np.float32
_ONE, _HALF = _F(1), _F(0.5)
_PI, _HALF_PI, _QUARTER_PI = _F(np.pi), _F(np.pi / 2), _F(np.pi / 4)
#: What float32 leaves of pi / 2, so that the sum of both is pi / 2.
_HALF_PI_REST = _F(np.pi / 2 - float(_HALF_PI))

# (asin(x) - x) / x^3 for x^2 up to 1/4, coefficients of rising powers of x^2
_ARC_SINE = tuple(map(_F, (0.166667506, 0.0749534369, 0.0454662591, 0.0241948012, 0.0421460979)))
# (atan(x) - x) / x^3 for x up to tan(pi / 8)
_ARC_TANGENT = tuple(map(_F, (-0.333333164, 0.19998534, -0.14244549, 0.106004909, -0.0609358028)))
_TAN_EIGHTH = _F(0.41421357)
# (sin(x) - x) / x^3 and (cos(x) - 1 + x^2 / 2) / x^4 for x up to pi / 4
_SINE = tuple(map(_F, (-0.166666552, 0.00833215751, -0.000195143773)))
_COSINE = tuple(map(_F, (0.041666653, -0.00138877111, 2.44742641e-05)))
_QUARTERS = _F(2 / np.pi)
#: pi / 2 in three parts; the first two have 12 bits or less, so that their multiples are exact.
_PARTS = (_F(1.5703125), _F(4.837512969970703e-4), _F(7.549790126404332e-8))


def arc_cosine(x: Floats) -> Floats:
    """Arc cosine of -1 to 1, in rad."""
    size = np.abs(x)
    square = (_ONE - size) * _HALF
    root = np.sqrt(square)
    if np.size(x) and x.min() > _HALF:  # the usual case: angles below 60 deg, nothing to choose
        half: Floats = root + root * (square * _polynomial(_ARC_SINE, square))
        return half + half
    small = size <= _HALF
    square = np.where(small, x * x, square)
    base = np.where(small, x, root)
    sine = base + base * (square * _polynomial(_ARC_SINE, square))
    middle = _HALF_PI - (sine - _HALF_PI_REST)
    twice = sine + sine
    angles: Floats = np.where(small, middle, np.where(x > 0, twice, _PI - twice))
    return angles


def arc_tangent(y: Floats, x: Floats) -> Floats:
    """Angle of the point (x, y) in rad, -pi to pi; 0 for the origin. Zeros have no sign."""
    across, along = np.abs(x), np.abs(y)
    steep = along > across
    low, high = np.where(steep, across, along), np.where(steep, along, across)
    ratio = low / np.where(high == 0, _ONE, high)
    wide = ratio > _TAN_EIGHTH
    base = np.where(wide, (ratio - _ONE) / (ratio + _ONE), ratio)
    square = base * base
    angle = base + base * (square * _polynomial(_ARC_TANGENT, square))
    angle = np.where(wide, _QUARTER_PI + angle, angle)
    angle = np.where(steep, _HALF_PI - angle, angle)
    angle = np.where(x < 0, _PI - angle, angle)
    angles: Floats = np.where(y < 0, -angle, angle)
    return angles


def sine(x: Floats) -> Floats:
    """Sine of an angle in rad, of a few turns at most."""
    return _wave(x, 0)


def cosine(x: Floats) -> Floats:
    """Cosine of an angle in rad, of a few turns at most."""
    return _wave(x, 1)


def _wave(x: Floats, ahead: int) -> Floats:
    """Sine of the angle plus ``ahead`` quarters of a turn."""
    turns = x * _QUARTERS
    quarters = (turns + np.where(turns < 0, -_HALF, _HALF)).astype(np.int32)
    count = quarters.astype(np.float32)
    rest = x
    for part in _PARTS:
        rest = rest - count * part
    square = rest * rest
    odd = rest + rest * (square * _polynomial(_SINE, square))
    even = _ONE - (square * _HALF - square * (square * _polynomial(_COSINE, square)))
    quadrant = (quarters + np.int32(ahead)) & 3
    size = np.where(quadrant & 1, even, odd)
    wave: Floats = np.where(quadrant & 2, -size, size)
    return wave


def _polynomial(coefficients: tuple[np.float32, ...], x: Floats) -> Floats:
    value: Floats = x * coefficients[-1]
    for coefficient in coefficients[-2:0:-1]:
        value = (value + coefficient) * x
    return value + coefficients[0]
