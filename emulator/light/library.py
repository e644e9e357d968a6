"""The compiled library of this package, declared for ctypes; without it, callers use NumPy."""

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light import noise
from cubestack.emulator.native.inner_loops import inner_loops

FOLDER = Path(__file__).parent

TITLE = "the inner loops of light"

Library = Any
"""The loaded library with these functions."""


class NoiseRecord(ctypes.Structure):
    """``NoiseSource`` of noise.h."""

    _fields_ = (
        ("key", ctypes.c_uint64 * 2),
        ("pieces", ctypes.c_void_p),
        ("shift", ctypes.c_int32),
        ("first", ctypes.c_int32),
    )


class GlobeRecord(ctypes.Structure):
    """``Globe`` of globe.cpp."""

    _fields_ = (
        *((name, ctypes.c_float) for name in ("limit", "distance", "square", "twilight")),
        *((name, ctypes.c_float) for name in ("cosine", "sine", "per_height", "unevenness")),
        *((name, ctypes.c_float * 3) for name in ("centre", "closest", "sun")),
        ("sine_series", ctypes.c_float * 6),
        ("exp2_series", ctypes.c_float * 7),
        *((name, ctypes.c_float) for name in ("to_whole", "log2_e", "smallest")),
        ("waves", ctypes.c_int32),
        ("table", ctypes.c_void_p),
    )


_P, _I, _L, _D = ctypes.c_void_p, ctypes.c_int32, ctypes.c_int64, ctypes.c_double
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "light_grey_values": (None, (_P, _I, _I, _P)),
    "light_undistorted": (None, (_P, _P, _L, _I, _D, _P)),
    "light_displaced": (None, (_P, _P, _P, _P, _L, _P, _P)),
    "light_spots": (None, (_P, _P, _L, _D, _I, _P, _I, _I, _P)),
    "light_globe": (_L, (_P, _P, _P, _L, _P, _P)),
}


_library: Library | None = None


def light_library() -> Library | None:
    """The library of this process; None, with a warning, where there is no C++ compiler.

    Raises:
        CompilerError: the compiler failed.
    """
    global _library
    if _library is None:
        _library = inner_loops(TITLE, [*FOLDER.glob("*.cpp"), *FOLDER.glob("*.h")])
        for name, (result, arguments) in _FUNCTIONS.items() if _library is not None else ():
            function = getattr(_library, name)
            function.restype, function.argtypes = result, arguments
    return _library


def address(array: NDArray[Any] | None) -> int | None:
    """Where the numbers of ``array`` are, for a call."""
    return None if array is None else array.__array_interface__["data"][0]


def noise_of(frame: noise.FrameNoise | None) -> NoiseRecord:
    """The noise of a frame for C++; zeros for none."""
    if frame is None:
        return NoiseRecord()
    key = (ctypes.c_uint64 * 2)(*map(int, frame.key))
    return NoiseRecord(key, address(_pieces()), noise.SHIFT, noise.FIRST)


@cache
def _pieces() -> NDArray[np.float32]:
    """Level and slope of each piece side by side, (n, 2)."""
    return np.ascontiguousarray(np.stack(noise.pieces(), axis=1))
