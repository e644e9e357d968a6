"""Images that the cameras of a device rendered."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def cameras_of(board: Any) -> Sequence[Any]:
    """All image sensors of a board, in its order."""
    return list(board.cameras.values()) if hasattr(board, "cameras") else [board.camera]


def picture_of(board: Any) -> NDArray[np.uint8] | None:
    """The last rendered images of all cameras side by side, or None."""
    rendered = [camera.rendered for camera in cameras_of(board)]
    shown = [picture for picture in rendered if picture is not None]
    return np.hstack(shown) if shown else None
