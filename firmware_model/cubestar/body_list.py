"""Directions of planets and the Moon that the host uploads (telecommand SetBody), in flash.

Whoever flies the satellite has an ephemeris and knows where it is, which moves the Moon by up to a
degree; the node has neither. So the host sends directions, each with its accuracy and how long it
holds, counted by the node's own timer. That timer starts anew with the power, so the list is erased
then.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import direction_of
from cubestack.firmware_model.interface.cubestar.extensions import MOST_BODIES
from cubestack.firmware_model.mcu.costs import Meter

_S_PER_MINUTE = 60


@dataclass(frozen=True, eq=False)
class Body:
    """A planet, or with a radius the Moon."""

    direction: NDArray[np.float32]  #: (3,) inertial unit vector
    radius_rad: float  #: angular radius; 0 for a point of light
    accuracy_rad: float  #: standard deviation of the direction in each axis
    until_s: int  #: uptime after which it no longer holds; 0: not listed

    LAYOUT = struct.Struct("<5fI")

    @classmethod
    def of_command(cls, values: Mapping[str, Any], uptime_us: int, meter: Meter) -> "Body":
        """The parameters of SetBody, which arrived at ``uptime_us``."""
        lasts_s, now_s = _S_PER_MINUTE * int(values["Minutes"]), uptime_us // 1_000_000
        direction = direction_of(values["RightAscension"], values["Declination"], meter)
        until_s = now_s + lasts_s if lasts_s else 0
        return cls(direction, values["Radius"], values["Accuracy"], until_s)

    def pack(self) -> bytes:
        numbers = (*self.direction.tolist(), self.radius_rad, self.accuracy_rad)
        return self.LAYOUT.pack(*numbers, self.until_s)

    @classmethod
    def unpack(cls, data: bytes) -> "Body":
        *direction, radius, accuracy, until_s = cls.LAYOUT.unpack(data)
        return cls(np.array(direction, np.float32), radius, accuracy, until_s)


PAGE_BYTES = MOST_BODIES * Body.LAYOUT.size


def read_bodies(page: bytes | None) -> list[Body]:
    """All places of the list, used or not."""
    data, size = page or bytes(PAGE_BYTES), Body.LAYOUT.size
    return [Body.unpack(data[at : at + size]) for at in range(0, PAGE_BYTES, size)]


def pack_bodies(bodies: Sequence[Body]) -> bytes:
    return b"".join(body.pack() for body in bodies)
