"""What the cameras of a powered-up device have rendered."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def cameras_of(board: Any) -> Sequence[Any]:
    """All image sensors of a board, in its order."""
    return list(board.cameras.values()) if hasattr(board, "cameras") else [board.camera]


def picture_of(board: Any) -> NDArray[np.uint8] | None:
    """What the cameras rendered last, side by side; None where none of them did."""
    rendered = [camera.rendered for camera in cameras_of(board)]
    shown = [picture for picture in rendered if picture is not None]
    return np.hstack(shown) if shown else None
