"""What a logic analyser recorded: channels, and the changes of their levels."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

UNKNOWN = -1
"""Level of a channel that the file gives as x or z, or not at all."""

WIDEST = 32
"""Bits of the widest channel whose level is read; no pin table has a wider pin."""


LATEST_PS = 1 << 62
"""Latest time of a change."""


class CaptureError(ValueError):
    """A file that is no capture, or does not fit the device: one line."""


class Channel(NamedTuple):
    """A column or variable of the file."""

    name: str  #: without the scopes around it
    width: int = 1
    path: str = ""  #: with the scopes

    @property
    def full_name(self) -> str:
        return self.path or self.name


@dataclass(frozen=True)
class Capture:
    """Channels and their changes, in the order of the file.

    Attributes:
        channels: by number.
        times: time of each change in ps, shape (n,); never decreases.
        numbers: channel of each change, shape (n,).
        levels: new level of each change, shape (n,); ``UNKNOWN`` for none.
        end_ps: time of the last sample.
        sample_ps: sampling period; None if the file does not give it.
    """

    channels: tuple[Channel, ...]
    times: NDArray[np.int64]
    numbers: NDArray[np.int32]
    levels: NDArray[np.int64]
    end_ps: int
    sample_ps: float | None = None


def rate_period_ps(text: str) -> float | None:
    """Period of a sampling rate such as "24 MHz"; None for a text that is none."""
    number, _, unit = text.strip().partition(" ")
    scale = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}.get(unit.strip().lower())
    try:
        rate = float(number) * (scale or 0.0)
    except ValueError:
        return None
    return 1e12 / rate if rate > 0 else None
