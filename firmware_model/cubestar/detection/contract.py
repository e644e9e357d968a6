"""Settings, results and memory accesses of a star search."""

from collections.abc import Generator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.star_tracker.quality import SkyStatistics
from cubestack.firmware_model.values import DeclaredValues, flag, whole


class DetectionConfigError(ValueError):
    """A detection setting out of range."""


class SearchEnd(Enum):
    """Why a search ended."""

    COMPLETE = "the whole region was searched"
    STARS = "the list of stars was full"
    INVALID = "there were too many invalid areas"
    NOISE = "there were too many noise areas"
    TIME = "the time for a search was over"


@dataclass(frozen=True)
class DetectionConfig(DeclaredValues):
    """Settings of telecommands 20 to 23, with the published values as defaults.

    In the background search both thresholds count from the background up, every pixel is read
    whatever the step, twice ``max_stars`` are kept, and too many areas do not end the search.
    """

    error = DetectionConfigError

    step: int = whole(3, "distance of sampled pixels and rows", 1, 255, "px")
    x_start: int = whole(0, "first column of the samples", 0, 65_535, "px")
    x_end: int = whole(1024, "column after the last one", 0, 65_535, "px")
    y_start: int = whole(0, "first row of the samples", 0, 65_535, "px")
    y_end: int = whole(512, "row after the last one", 0, 65_535, "px")
    detection_threshold: int = whole(
        6, "a sample above it and the star threshold starts an area", 0, 255, "DN"
    )
    star_threshold: int = whole(6, "a neighbour above it joins the area", 0, 255, "DN")
    min_pixels: int = whole(6, "smaller areas are noise", 1, 255, "px")
    max_pixels: int = whole(60, "larger areas are invalid", 1, 255, "px")
    grid_size: int = whole(5, "width of the square that gives the centroid, odd", 1, 255, "px")
    max_stars: int = whole(20, "the search ends after this number of stars", 1, 255)
    max_invalid: int = whole(50, "the search ends with more invalid areas", 0, 255)
    max_noise: int = whole(255, "the search ends with more noise areas", 0, 255)
    plain_weights: bool = flag(
        False, "a pixel weighs its value, else its value above the star threshold"
    )
    background: bool = flag(False, "the search above the local background")

    def __post_init__(self) -> None:
        """Refuse settings with which the search makes no sense: DetectionConfigError."""
        super().__post_init__()
        self.check_within("max_pixels", low=self.min_pixels)
        self.check_within("x_end", low=self.x_start + 1)
        self.check_within("y_end", low=self.y_start + 1)
        if self.grid_size % 2 == 0:
            raise DetectionConfigError(f"grid_size must be odd, not {self.grid_size}")

    @property
    def seed_threshold(self) -> int:
        """What a sample must exceed to start an area, DN."""
        return max(self.detection_threshold, self.star_threshold)

    def check_region(self, rows: int, columns: int) -> None:
        """Raise DetectionConfigError, naming the edge, for a region beyond an image of ``rows`` by
        ``columns``."""
        self.check_within("x_end", high=columns)
        self.check_within("y_end", high=rows)


@dataclass(frozen=True)
class PictureStatistics(SkyStatistics):
    """What the background search measured of the picture, beside its stars."""

    large: int  #: areas of too many pixels: Moon, limb, horizon
    elongated: int  #: areas drawn out in one direction: streaks, tracks of particles
    #: 1 where all areas are drawn out in the same direction, 0 where none are or all differ:
    #: streaks of stars share their direction, tracks of particles do not, and the edge of
    #: something large is beside stars that are round.
    aligned: float
    streak_px: float  #: median length of the elongated ones in px; 0 without any
    spot_px: float  #: standard deviation of a star's spot with the pixel's own width


def _unknown() -> NDArray[np.float32]:
    return np.zeros(0, np.float32)


@dataclass(frozen=True, eq=False)
class Detection:
    """What a search found: row by row, or the brightest star first (background search)."""

    centroids: NDArray[np.float32]  #: (n, 2) x and y in px
    sizes: NDArray[np.uint8]  #: (n,) pixels of each area
    #: (n,) sum of the values of each area's pixels, DN; of the background search the light above
    #: the background, 65 535 at most
    intensities: NDArray[np.uint16]
    invalid: int  #: areas above the maximum size; the background search stops counting at 255
    noise: int  #: areas below the minimum size; the same
    dark_value: int  #: mean of the sampled background in DN, 0 when nothing was background
    end: SearchEnd  #: why the search ended
    #: (n,) expected standard deviation of each centroid along one axis in px; empty where the
    #: search does not know
    errors_px: NDArray[np.float32] = field(default_factory=_unknown)
    #: of the picture; None where the search does not know
    statistics: PictureStatistics | None = None
    #: cells (down, across) of the whole picture in which no star can be seen, likewise
    blind: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Look:
    """Read pixels ``offsets`` (n,) int32 one after the other, up to and including the first above
    ``above``. The answer is their values, uint8."""

    offsets: NDArray[np.int32]
    above: int = 255


@dataclass(frozen=True)
class Put:
    """Write pixels: ``offsets`` (n,) int32, ``values`` (n,) uint8."""

    offsets: NDArray[np.int32]
    values: NDArray[np.uint8]


#: A search; whoever runs it performs the accesses and charges them.
Search = Generator[Look | Put, Any, Detection]
