"""Constant C arrays (C99) of numbers, to be compiled into flight software.

CubeStar thesis, appendix A (the generator of star list and list of distances) and section 5.3.2
(constant arrays in flash).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

TYPES = {"u2": "uint16_t", "i2": "int16_t", "u4": "uint32_t", "f4": "float"}
"""C types by NumPy's names, without byte order."""

PER_LINE = 8


def c_arrays(prefix: str, arrays: Mapping[str, NDArray[np.generic]], about: str) -> str:
    """Text of a C file with each array (n,) as ``prefix_name`` and ``PREFIX_NAME_COUNT``.

    Floats have enough digits to read back exactly. Raises ValueError for an array of another shape
    or of a type not in ``TYPES``.
    """
    lines = [f"/* {about} */", "#include <stdint.h>"]
    for name, array in arrays.items():
        kind = array.dtype.str[1:]
        if kind not in TYPES or array.ndim != 1:
            raise ValueError(f"{name} must be one row of {', '.join(TYPES)}, not {array.dtype}")
        count = f"{prefix}_{name}_count".upper()
        lines += ["", f"#define {count} {len(array)}"]
        lines.append(f"const {TYPES[kind]} {prefix}_{name}[{count}] = {{")
        texts = [f"{value:.9e}f" if kind == "f4" else str(value) for value in array.tolist()]
        rows = [texts[at : at + PER_LINE] for at in range(0, len(texts), PER_LINE)]
        lines += [f"    {', '.join(row)}," for row in rows]
        lines.append("};")
    return "\n".join(lines) + "\n"
