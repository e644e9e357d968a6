"""The error of a lens over its field: a smooth curve over the angle, and decentring.

`reference` is NumPy; `lens_curve.cpp` does the same operations in the same order, so both are equal
to the bit.
"""

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light.library import Library, address, light_library

Numbers = NDArray[np.float64]

FEW = 4096
"""Points that take NumPy no time to speak of: the library is not loaded for them."""


class _Record(ctypes.Structure):
    """``LensCurve`` of lens_curve.cpp."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("nodes", "values", "slopes")),
        ("count", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("rim", "p1", "p2")),
    )


@dataclass(frozen=True, eq=False)
class LensCurve:
    """Outward errors at field angles, with Brown's decentring, which fades towards the rim.

    Hermite's cubics go through the errors, with extremes at nodes only (Fritsch).
    """

    nodes: Numbers  #: rising angles (k,), the first one 0
    values: Numbers  #: errors (k,)
    p1: float
    p2: float

    @property
    def slopes(self) -> Numbers:
        """Slopes (k,) of the curve at the nodes."""
        rise = np.diff(self.values) / np.diff(self.nodes)
        turns = rise[:-1] * rise[1:] <= 0
        mean = 2 * rise[:-1] * rise[1:] / np.where(turns, 1, rise[:-1] + rise[1:])
        return np.array([rise[0], *np.where(turns, 0, mean), 0.0])

    def displaced(self, x: Numbers, y: Numbers) -> tuple[Numbers, Numbers]:
        """The angles ``x`` and ``y``, of one shape, with their errors added."""
        library = None if x.size < FEW else light_library()
        return self.reference(x, y) if library is None else self.compiled(library, x, y)

    def reference(self, across: Numbers, down: Numbers) -> tuple[Numbers, Numbers]:
        """The same by NumPy."""
        theta, rim = np.hypot(across, down), self.nodes[-1]
        stretch = 1 + self._radial(theta) / np.where(theta == 0, 1, theta)
        x, y = across / rim, down / rim
        square = x * x + y * y
        fading = np.maximum(1 - square, 0)
        return (
            across * stretch + fading * (self.p2 * (square + 2 * x * x) + 2 * self.p1 * x * y),
            down * stretch + fading * (self.p1 * (square + 2 * y * y) + 2 * self.p2 * x * y),
        )

    def compiled(self, library: Library, x: Numbers, y: Numbers) -> tuple[Numbers, Numbers]:
        """The same by the compiled library."""
        x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)
        arrays = [np.ascontiguousarray(one) for one in (self.nodes, self.values, self.slopes)]
        lens = _Record(*map(address, arrays), len(self.nodes), self.nodes[-1], self.p1, self.p2)
        theta, to_x, to_y = np.hypot(x, y), np.empty_like(x), np.empty_like(y)
        given = (address(one) for one in (theta, x, y))
        library.light_displaced(ctypes.byref(lens), *given, x.size, address(to_x), address(to_y))
        return to_x, to_y

    def _radial(self, theta: Numbers) -> Numbers:
        nodes, values, slopes = self.nodes, self.values, self.slopes
        first = np.clip(np.searchsorted(nodes, theta, "right") - 1, 0, len(nodes) - 2)
        width = nodes[first + 1] - nodes[first]
        s = np.clip((theta - nodes[first]) / width, 0, 1)
        begins = (1 + 2 * s) * values[first] + s * width * slopes[first]
        ends = (3 - 2 * s) * values[first + 1] - (1 - s) * width * slopes[first + 1]
        return np.asarray((1 - s) ** 2 * begins + s**2 * ends)
