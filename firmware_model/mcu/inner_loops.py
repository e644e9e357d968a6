"""Inner loops in C++ beside the Python form, which is the reference.

A C++ file lies beside the module whose loops it contains. It returns the same bits, and the same
counts, from which Python charges the same operations. Nothing here compiles: the emulator builds
one library of all of them and offers it with ``use_loops``. Until then the Python form runs.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

INT, FLOAT = ctypes.c_int64, ctypes.c_double
"""Arguments that are numbers."""


POINTER = ctypes.c_void_p
"""Argument that is the address of an array, see ``address``."""


def address(array: NDArray[Any]) -> int:
    """Where the elements of an array in C order begin; the caller keeps the array."""
    if not array.flags.c_contiguous:
        raise ValueError("the elements are not in C order")
    begin: int = array.__array_interface__["data"][0]  # half the time of .ctypes.data
    return begin


def _array(kind: Any) -> Any:
    return np.ctypeslib.ndpointer(kind, flags="C_CONTIGUOUS")


BYTES, INTS, REALS = _array(np.uint8), _array(np.int64), _array(np.float64)
INT32S, FLOATS, MARKS = _array(np.int32), _array(np.float32), _array(np.bool_)
NAMES = _array(np.uint16)
"""Arguments that are arrays in C order, of any shape."""

_library: ctypes.CDLL | None = None


def use_loops(library: ctypes.CDLL | None) -> None:
    """Use ``library`` from now on; None: the Python form."""
    global _library
    _library = library


def loops_in_use() -> ctypes.CDLL | None:
    return _library


@contextmanager
def python_form() -> Iterator[None]:
    """Use the Python form within the block."""
    library = _library
    use_loops(None)
    try:
        yield
    finally:
        use_loops(library)


class Loop:
    """A function of the library, which is false where there is none.

    Arrays of a wrong type or order raise ctypes.ArgumentError.
    """

    def __init__(self, name: str, *arguments: Any) -> None:
        self._name, self._arguments = name, arguments
        self._function: Any = None
        self._of: ctypes.CDLL | None = None

    def __bool__(self) -> bool:
        return _library is not None

    def __call__(self, *arguments: Any) -> int:
        if self._of is not _library:
            self._of, self._function = _library, getattr(_library, self._name)
            self._function.argtypes, self._function.restype = self._arguments, INT
        found: int = self._function(*arguments)
        return found
