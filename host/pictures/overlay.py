"""What a device found in a picture, to be drawn over it; pixels are column and row."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.host.clients.contract import DeviceClient
from cubestack.host.pictures.star_names import star_name


@dataclass(frozen=True)
class Mark:
    """A place: what it is, empty where the device does not know; a star's Hipparcos number."""

    x_px: float
    y_px: float
    name: str = ""
    hipparcos: int | None = None


@dataclass(frozen=True, eq=False)
class Overlay:
    """Places, and lines of points (n, 2)."""

    marks: Sequence[Mark] = ()
    lines: Sequence[NDArray[np.float64]] = ()


def star_overlay(client: DeviceClient, _picture: str) -> Overlay:
    """Stars of the latest picture, wherever that lies; raises the client's errors."""
    return Overlay(
        [
            Mark(star.x_px, star.y_px, name, star.hipparcos)
            for star in client.stars()
            for name in ["" if star.hipparcos is None else star_name(star.hipparcos)]
        ]
    )
