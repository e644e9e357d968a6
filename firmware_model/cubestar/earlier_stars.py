"""Stars of the image before, for the stellar gyro: what of them survives the software reset.

The reset that ends every iteration clears the RAM (CubeStar thesis, section 5.3.6), and flash would
wear out, so they are in the retention registers: as many as fit beside the rest.
"""

import struct
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

MOST_STARS = 9  #: the brightest ones

_STEPS = 64.0  #: to the px: positions are 16-bit numbers
_U32 = 0xFFFF_FFFF


def _none() -> NDArray[np.float32]:
    return np.zeros((0, 2), np.float32)


@dataclass
class EarlierStars:
    """Times are those of the free-running timer in us, modulo 2^32; 0: unknown."""

    image_us: int = 0  #: mid-exposure of the image in memory, of its middle row
    stars_us: int = 0  #: the same of the image that the centroids are from
    centroids: NDArray[np.float32] = field(default_factory=_none)  #: (n, 2) in px, n at most 9

    LAYOUT = struct.Struct(f"<IIB{2 * MOST_STARS}H")

    def note_time(self, exposed_us: int | None) -> None:
        """A new image is in memory; None if nobody knows when it was exposed."""
        self.image_us = 0 if exposed_us is None else exposed_us & _U32 or 1

    @property
    def apart_us(self) -> int:
        """From the earlier image to the one in memory."""
        return (self.image_us - self.stars_us) & _U32

    def pack(self) -> bytes:
        raw = np.round(self.centroids * _STEPS).clip(0, 0xFFFF).astype(int).ravel().tolist()
        padding = [0] * (2 * MOST_STARS - len(raw))
        return self.LAYOUT.pack(self.image_us, self.stars_us, len(raw) // 2, *raw, *padding)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        image_us, stars_us, count, *raw = cls.LAYOUT.unpack(data)
        known = min(count, MOST_STARS)  # an upset may have changed it
        centroids = np.array(raw[: 2 * known], np.float32).reshape(known, 2)
        return cls(image_us, stars_us, centroids / np.float32(_STEPS))
