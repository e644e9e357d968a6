"""Pictures for people: grey values stretched and as PNG, marked stars, arrows of residuals."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cubestack.host.clients.contract import FoundStar
from cubestack.host.pictures.files import CALIBRATE, DEMO, save_png
from cubestack.host.pictures.overlay import star_name
from cubestack.host.pictures.sheet import GRID, TRUTH, Entry, Lens, Sheet

FEWEST_COUNTS = 24
"""Range of grey values that is stretched to the whole, at least: noise is not made a picture."""

DARKEST, BRIGHTEST = 1.0, 99.98
"""Percentiles that become black and white: hot or dead pixels alone do not set the scale."""

SKY = 50.0
"""The same of black where at least half of a picture is dark sky."""

GAMMA = 0.6

SAMPLE_PX = 480
"""Width of a small picture."""


def stretched(
    picture: NDArray[np.uint8], darkest: float = DARKEST, gamma: float = GAMMA
) -> NDArray[np.uint8]:
    """``picture`` between two of its percentiles, with a gamma.

    Args:
        picture: grey values (rows, columns).
        darkest: percentile, 0 to 100, at and below which it becomes black.
        gamma: exponent; below 1 it lifts what is faint.
    """
    low, high = np.percentile(picture, (darkest, BRIGHTEST))
    spread = max(float(high - low), FEWEST_COUNTS)
    grey = 255 * np.clip((picture - low) / spread, 0, 1) ** gamma
    return np.asarray(grey, np.uint8)


CIRCLE, TICKS = 0.6, 1.05
"""Sizes of marks, in heights of the text."""

NEAR_PX = 3.0
"""A centroid that near to a star's true place is that star's."""

IDENTIFIED = (120, 255, 120)
UNKNOWN = (255, 140, 90)


@dataclass(frozen=True)
class TrueStar:
    """Where a star really is in a picture, px; known to whoever made the scene."""

    hipparcos: int
    x_px: float
    y_px: float


def save_picture(picture: NDArray[np.uint8], path: Path, command: str = "cubestack") -> None:
    """Write grey values (rows, columns) unchanged, as ``save_png`` does."""
    save_png(Image.fromarray(picture), path, command)


def save_sample(picture: NDArray[np.uint8], path: Path | BinaryIO) -> None:
    """Write grey values (rows, columns) as a small JPEG that is stretched for the eye.

    As ``stretched`` does it.
    """
    image = Image.fromarray(stretched(picture))
    height = round(SAMPLE_PX * picture.shape[0] / picture.shape[1])
    image.resize((SAMPLE_PX, height), Image.Resampling.LANCZOS).save(
        path, "JPEG", quality=70, optimize=True
    )


def png(picture: NDArray[np.uint8]) -> bytes:
    """Grey values (rows, columns) as PNG, quickly rather than small."""
    file = BytesIO()
    Image.fromarray(picture).save(file, "png", compress_level=1)
    return file.getvalue()


def annotate(
    picture: NDArray[np.uint8],
    stars: Sequence[FoundStar],
    path: Path,
    title: str,
    left_out: Sequence[str] = (),
    lens: Lens | None = None,
    truth: Sequence[TrueStar] = (),
) -> None:
    """Write ``star_sheet`` of the same arguments as a PNG."""
    save_png(star_sheet(picture, stars, title, left_out, lens, truth), path, DEMO)


def star_sheet(
    picture: NDArray[np.uint8],
    stars: Sequence[FoundStar],
    title: str,
    left_out: Sequence[str] = (),
    lens: Lens | None = None,
    truth: Sequence[TrueStar] = (),
) -> Image.Image:
    """``picture`` stretched, each star circled and, when identified, named; a legend below.

    Args:
        picture: grey values (rows, columns).
        stars: what the device found in it.
        title: what it is a picture of.
        left_out: what the device saw and did not take, and why; with the number.
        lens: for the grid of angles; None for no grid.
        truth: where stars really are, which no device knows.
    """
    sheet = Sheet(stretched(picture, SKY))
    if lens is not None:
        sheet.grid(lens, widest_deg(lens, picture.shape))
    for true in truth:
        sheet.mark("ticks", np.array([true.x_px, true.y_px]), TRUTH, TICKS)
    named = [star for star in stars if star.hipparcos is not None]
    for star in stars:
        known = star.hipparcos is not None
        name = star_name(star.hipparcos) if star.hipparcos is not None else ""
        at = np.array([star.x_px, star.y_px])
        sheet.mark("circle", at, IDENTIFIED if known else UNKNOWN, CIRCLE, name)
    told = [f"{len(stars)} stars found, {len(named)} of them identified"]
    told += [f"left out: {', '.join(left_out)}"] if left_out else []
    legend = []
    if named:
        legend.append(Entry("circle", IDENTIFIED, "identified by the device"))
    if len(named) < len(stars):
        legend.append(Entry("circle", UNKNOWN, "found, not identified"))
    if truth:
        at = np.array([[star.x_px, star.y_px] for star in stars]).reshape(-1, 2)
        missed = sum(
            not np.any(np.hypot(*(at - (true.x_px, true.y_px)).T) < NEAR_PX) for true in truth
        )
        told.append(f"{len(truth) - missed} of the {len(truth)} bright stars in the field found")
        legend.append(Entry("ticks", TRUTH, "bright star's true place (not told to the device)"))
    if lens is not None:
        legend.append(Entry("cross", GRID, "boresight, angles from it"))
    return sheet.finished(title, "; ".join(told), legend)


def widest_deg(lens: Lens, shape: tuple[int, ...]) -> float:
    """Angle between the boresight and the farthest corner of a picture (rows, columns), deg.

    To half a degree, at most 89.5.
    """
    angles = np.arange(0.5, 90, 0.5)
    around = np.radians(np.arange(0, 360, 5))
    for angle in angles:
        across, along = np.sin(np.radians(angle)), np.cos(np.radians(angle))
        ring = [across * np.cos(around), across * np.sin(around), np.full(len(around), along)]
        places = lens(np.stack(ring, axis=1))
        if not np.any(np.all((places >= 0) & (places < shape[::-1]), axis=1)):
            return float(angle)
    return float(angles[-1])


BACKGROUND, FRAME, ARROW, PLACE = (255, 255, 255), (190, 190, 190), (200, 40, 40), (60, 60, 60)
LONGEST_PX = 40.0
MARGIN_PX = 40
ROUND = (1, 2, 5)


def save_residuals(places: NDArray[np.float64], residuals: NDArray[np.float64], path: Path) -> None:
    """Write a PNG with ``residuals`` (n, 2) at ``places`` (n, 2), both px, magnified alike.

    The magnification is a round one, which the picture says; most arrows are at most 40 px long.
    """
    width, height = (int(side) + 2 * MARGIN_PX for side in np.ceil(places.max(axis=0)))
    image = Image.new("RGB", (width, height), BACKGROUND)
    draw = ImageDraw.Draw(image)
    draw.rectangle((MARGIN_PX, MARGIN_PX, width - MARGIN_PX, height - MARGIN_PX), outline=FRAME)
    scale = _round(LONGEST_PX / max(float(np.percentile(np.hypot(*residuals.T), 95)), 1e-9))
    for (x, y), (dx, dy) in zip(places + MARGIN_PX, residuals * scale, strict=True):
        draw.ellipse((x - 2, y - 2, x + 2, y + 2), fill=PLACE)
        draw.line((x, y, x + dx, y + dy), fill=ARROW)
    draw.text((MARGIN_PX, 12), f"measured less fitted, magnified {scale:g} times", fill=PLACE)
    save_png(image, path, CALIBRATE)


def _round(value: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is not above ``value``."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in ROUND if step * power <= value * (1 + 1e-9)))
