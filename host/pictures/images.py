"""Pictures for people: grey values as PNG, and a picture with its stars marked."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cubestack.host.clients.contract import FoundStar
from cubestack.host.pictures.star_names import star_name

RADIUS_PX = 9
TEXT_PX = 12
IDENTIFIED = (120, 255, 120)
UNKNOWN = (255, 140, 90)

#: Display gamma: lifts faint stars out of the black without touching the file with the raw values.
GAMMA = 0.5


def save_picture(picture: NDArray[np.uint8], path: Path) -> None:
    """Write grey values (rows, columns) unchanged as PNG."""
    Image.fromarray(picture).save(path)


def png(picture: NDArray[np.uint8]) -> bytes:
    """Grey values (rows, columns) as PNG, quickly rather than small."""
    file = BytesIO()
    Image.fromarray(picture).save(file, "png", compress_level=1)
    return file.getvalue()


def annotate(picture: NDArray[np.uint8], stars: Sequence[FoundStar], path: Path) -> None:
    """Write ``picture`` brightened, each star circled and, when identified, named."""
    lifted = (255 * (picture / 255.0) ** GAMMA).astype(np.uint8)
    image = Image.fromarray(lifted).convert("RGB")
    draw = ImageDraw.Draw(image)
    for star in stars:
        colour = UNKNOWN if star.hipparcos is None else IDENTIFIED
        x, y = star.x_px, star.y_px
        draw.ellipse((x - RADIUS_PX, y - RADIUS_PX, x + RADIUS_PX, y + RADIUS_PX), outline=colour)
        label = "not identified" if star.hipparcos is None else star_name(star.hipparcos)
        left = x + RADIUS_PX + 3
        if left + draw.textlength(label) > image.width:
            left = x - RADIUS_PX - 3 - draw.textlength(label)
        top = min(max(y - TEXT_PX / 2, 0), image.height - TEXT_PX)
        draw.text((left, top), label, fill=colour)
    image.save(path)
