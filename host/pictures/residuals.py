"""Residuals of a calibration as a picture: an arrow at each place."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

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
    image.save(path)


def _round(value: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is not above ``value``."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in ROUND if step * power <= value * (1 + 1e-9)))
