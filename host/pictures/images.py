"""Pictures for people: grey values as PNG, and a picture with its stars marked."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cubestack.host.clients.contract import FoundStar
from cubestack.host.pictures.sheet import GRID, TRUTH, Entry, Lens, Sheet
from cubestack.host.pictures.star_names import star_name
from cubestack.host.pictures.stretch import SKY, stretched

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


def save_picture(picture: NDArray[np.uint8], path: Path) -> None:
    """Write grey values (rows, columns) unchanged as PNG."""
    Image.fromarray(picture).save(path)


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
    star_sheet(picture, stars, title, left_out, lens, truth).save(path)


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
