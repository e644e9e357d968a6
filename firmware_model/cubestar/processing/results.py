"""What the steps found in the latest picture."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import Detection
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.interface.cubestar.codes import MatchMode


@dataclass
class Results:
    """Results of the latest picture; each is None until its step succeeded."""

    detection: Detection | None = None  #: centroids and counts
    #: undistorted centroids (n, 2) in px
    points: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    #: camera unit vectors (n, 3)
    vectors: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    identification: Identification | None = None  #: identity of each centroid
    mode: MatchMode = MatchMode.LOST_IN_SPACE  #: MatchMode that identified it
    best: list[int] = field(default_factory=list)  #: indices of the selected stars, at most three
    #: number and time of the picture, as in ``Attitude``
    frame: int = 0
    image_ms: int = 0
