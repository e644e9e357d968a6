"""What the steps found in the latest picture."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import Detection
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.interface.cubestar.codes import MatchMode


@dataclass
class Results:
    """Results of the latest picture; each is None until its step succeeded.

    Attributes:
        detection: centroids and counts.
        points: undistorted centroids (n, 2) in px.
        vectors: camera unit vectors (n, 3).
        identification: identity of each centroid.
        mode: MatchMode that identified it.
        best: indices of the selected stars, at most three.
        frame, image_ms: number and time of the picture, as in ``Attitude``.
    """

    detection: Detection | None = None
    points: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    vectors: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    identification: Identification | None = None
    mode: MatchMode = MatchMode.LOST_IN_SPACE
    best: list[int] = field(default_factory=list)
    frame: int = 0
    image_ms: int = 0
