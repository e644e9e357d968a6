"""What every star search is asked and answers, and how it reaches a picture that is elsewhere."""

from collections.abc import Generator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class DetectionConfigError(ValueError):
    """A detection setting out of range; `setting` names the field of `DetectionConfig`."""

    def __init__(self, setting: str, requirement: str) -> None:
        """Say which setting must be what."""
        super().__init__(f"{setting} must be {requirement}")
        self.setting = setting


class SearchEnd(Enum):
    """Why a search ended."""

    COMPLETE = "the whole region was searched"
    STARS = "the list of stars was full"
    INVALID = "there were too many invalid areas"
    NOISE = "there were too many noise areas"
    TIME = "the time for a search was over"


@dataclass(frozen=True)
class DetectionConfig:
    """Settings of telecommands 20 to 23, with the published values as defaults.

    Attributes:
        step: distance of sampled pixels and rows in px; the background search reads all.
        x_start, x_end, y_start, y_end: region of the samples in px, ends excluded.
        detection_threshold: a sample above it (and the star threshold) starts an area, DN.
        star_threshold: a neighbour above it joins the area, DN. Both count from the background up
            in the background search.
        min_pixels: smaller areas are noise.
        max_pixels: larger areas are invalid.
        grid_size: width of the square around the brightest pixel that gives the centroid, odd.
        max_stars: the search ends with so many stars; the background search keeps twice as many,
            the brightest ones.
        max_invalid: the search ends with more invalid areas; the background search goes on.
        max_noise: the search ends with more noise areas; the background search goes on.
        plain_weights: a pixel weighs its value, else its value above the star threshold.
        background: thresholds count from the local background of the picture, and every pixel is
            read (`background_search`).
    """

    step: int = 3
    x_start: int = 0
    x_end: int = 1024
    y_start: int = 0
    y_end: int = 512
    detection_threshold: int = 6
    star_threshold: int = 6
    min_pixels: int = 6
    max_pixels: int = 60
    grid_size: int = 5
    max_stars: int = 20
    max_invalid: int = 50
    max_noise: int = 255
    plain_weights: bool = False
    background: bool = False

    def __post_init__(self) -> None:
        """Refuse settings with which the search makes no sense."""
        limits = {
            **dict.fromkeys(("detection_threshold", "star_threshold"), (0, 255)),
            **dict.fromkeys(("max_invalid", "max_noise"), (0, 255)),
            **dict.fromkeys(("step", "min_pixels", "max_stars", "grid_size"), (1, 255)),
            "max_pixels": (self.min_pixels, 255),
            "x_end": (self.x_start + 1, 65_535),
            "y_end": (self.y_start + 1, 65_535),
            **dict.fromkeys(("x_start", "y_start"), (0, 65_535)),
        }
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise DetectionConfigError(name, f"{low} to {high}, not {value}")
        if self.grid_size % 2 == 0:
            raise DetectionConfigError("grid_size", f"odd, not {self.grid_size}")

    @property
    def seed_threshold(self) -> int:
        """What a sample must exceed to start an area, DN."""
        return max(self.detection_threshold, self.star_threshold)

    def check_region(self, rows: int, columns: int) -> None:
        """Refuse a region that reaches beyond a picture of so many rows and columns.

        Raises:
            DetectionConfigError: naming the edge that does.
        """
        for name, most in (("x_end", columns), ("y_end", rows)):
            if (value := getattr(self, name)) > most:
                raise DetectionConfigError(name, f"at most {most}, not {value}")


@dataclass(frozen=True)
class PictureStatistics:
    """What the background search measured of the picture, beside its stars.

    Attributes:
        background: mean level of the sky in DN.
        background_range: its brightest minus its darkest part (32 px wide) in DN.
        noise: median standard deviation of a pixel in DN.
        saturated: share of the picture at the end of the scale, 0 to 1.
        spikes: bright pixels and spots that no star leaves: hot pixels, particles.
        large: areas of too many pixels: Moon, limb, horizon.
        elongated: areas drawn out in one direction: streaks, tracks of particles.
        aligned: 1 where all areas are drawn out in the same direction, 0 where none are or all
            differ: streaks of stars share their direction, tracks of particles do not, and the
            edge of something large is beside stars that are round.
        streak_px: median length of these in px; 0 without any.
        spot_px: standard deviation of a star's spot in px, the pixel's own width in it; the usual
            one where fewer than three stars tell.
    """

    background: float
    background_range: float
    noise: float
    saturated: float
    spikes: int
    large: int
    elongated: int
    aligned: float
    streak_px: float
    spot_px: float


def _unknown() -> NDArray[np.float32]:
    return np.zeros(0, np.float32)


@dataclass(frozen=True, eq=False)
class Detection:
    """What a search found: row by row, or the brightest star first (background search).

    Attributes:
        centroids: (n, 2) x and y in px.
        sizes: (n,) pixels of each area.
        intensities: (n,) sum of the values of each area's pixels, DN; of the background search
            the light above the background, 65 535 at most.
        invalid: areas above the maximum size; the background search stops counting at 255.
        noise: areas below the minimum size; the same.
        dark_value: mean of the sampled background in DN, 0 when nothing was background.
        end: why the search ended.
        errors_px: (n,) expected standard deviation of each centroid along one axis in px; empty
            where the search does not know.
        statistics: of the picture; None where the search does not know.
        blind: cells (down, across) of the whole picture in which no star can be seen, likewise.
    """

    centroids: NDArray[np.float32]
    sizes: NDArray[np.uint8]
    intensities: NDArray[np.uint16]
    invalid: int
    noise: int
    dark_value: int
    end: SearchEnd
    errors_px: NDArray[np.float32] = field(default_factory=_unknown)
    statistics: PictureStatistics | None = None
    blind: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Look:
    """Read pixels one after the other, up to and with the first one above ``above``.

    The answer are the values read, uint8, at most as many as ``offsets``, (n,) int32.
    """

    offsets: NDArray[np.int32]
    above: int = 255


@dataclass(frozen=True)
class Put:
    """Write pixels: ``offsets`` (n,) int32, ``values`` (n,) uint8."""

    offsets: NDArray[np.int32]
    values: NDArray[np.uint8]


Search = Generator[Look | Put, Any, Detection]
"""A search; whoever runs it performs the accesses and charges them."""
