"""Quaternions as star trackers report them: scalar last, of length 1 but for rounding."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.host.errors import BadAnswerError

LENGTH_TOLERANCE = 0.01


def unit_quaternion(values: Mapping[str, Value], prefix: str = "Q") -> NDArray[np.float64]:
    """The quaternion (4,) in the fields ``prefix`` 0 to 3, scaled to length 1.

    Raises BadAnswerError when its length is more than 0.01 away from 1.
    """
    quaternion = np.array([float(values[f"{prefix}{index}"]) for index in range(4)])
    norm = float(np.linalg.norm(quaternion))
    if not abs(norm - 1.0) < LENGTH_TOLERANCE:
        raise BadAnswerError(f"the node's quaternion has length {norm:.4g}, not 1")
    return quaternion / norm
