"""Number types of the PIC18F45K20's compiler: int of 16 bits, float and double of 32.

CubeSense thesis, table 6.1.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

HUNDREDTHS = np.float32(100)  #: results are stored as int of 1/100 px (section 6.5.3.1)


def to_int16(values: NDArray[np.float32] | np.float32) -> NDArray[np.int16]:
    """Cast as C does on this part: towards zero, keeping only the low 16 bits."""
    return np.trunc(values).astype(np.int64).astype(np.int16)


def polynomial(terms: Sequence[np.float32], at: Any) -> Any:
    """Horner's rule, in single precision; ``terms`` from the constant one on."""
    value = terms[-1]
    for term in reversed(terms[:-1]):
        value = value * at + term
    return value


def sequential_sum(terms: NDArray[np.float32]) -> NDArray[Any]:
    """Sum over the first axis in single precision, one term after the other; 0 of none."""
    if len(terms) == 0:
        return np.zeros(terms.shape[1:], np.float32)
    total: NDArray[Any] = np.cumsum(terms, axis=0, dtype=np.float32)[-1]
    return total
