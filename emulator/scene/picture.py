"""Picture files as light: the part of a photograph that the sensor sees, in 8-bit grey values."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from cubestack.emulator.camera.common.optics import COLUMNS, ROWS

__all__ = ["FORMATS", "SceneError", "load_picture"]

FORMATS = ("PNG", "JPEG", "TIFF")


class SceneError(ValueError):
    """A scene that can not be: a wrong value, key, file or picture. The text is one line."""


def load_picture(
    file: Path, crop: Sequence[int], size: tuple[int, int] = (COLUMNS, ROWS)
) -> NDArray[np.uint8]:
    """Grey values of ``file`` from column and row ``crop`` on, read-only.

    ``size`` is columns and rows of the sensor, CubeStar's unless given; the shape is its reverse.

    Raises:
        SceneError: when the file is missing, damaged, of another format, too small, or so large
            that Pillow refuses it.
    """
    try:
        with Image.open(file) as image:
            if image.format not in FORMATS:
                raise SceneError(
                    f"{file.name} is a {image.format} picture; right would be {', '.join(FORMATS)}"
                )
            _check_size(file, image.size, crop, size)
            box = (crop[0], crop[1], crop[0] + size[0], crop[1] + size[1])
            pixels = _grey(file, image.crop(box))
    except SceneError:
        raise
    except UnidentifiedImageError:
        raise SceneError(
            f"{file.name} is no picture; right would be {', '.join(FORMATS)}"
        ) from None
    except Exception as error:  # Pillow's decoders raise whatever damaged data lead them to
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{file.name} can not be read: {reason}") from None
    pixels.flags.writeable = False
    return pixels


def _check_size(
    file: Path, size: tuple[int, int], crop: Sequence[int], sensor: tuple[int, int]
) -> None:
    x, y = crop
    columns, rows = sensor
    if x < 0 or y < 0:
        raise SceneError(f"crop must not be negative, not {x},{y}")
    if size[0] < x + columns or size[1] < y + rows:
        raise SceneError(
            f"{file.name} is {size[0]} x {size[1]} pixels; with crop {x},{y} it would have to be "
            f"at least {x + columns} x {y + rows}"
        )


def _grey(file: Path, image: Image.Image) -> NDArray[np.uint8]:
    """8-bit grey values; colours by their luma, 16 bits by their upper 8."""
    if image.mode.startswith("I;16"):
        wide: NDArray[np.uint16] = np.asarray(image).astype(np.uint16)
        return (wide >> 8).astype(np.uint8)
    if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr"):
        raise SceneError(
            f"{file.name} has pixels of kind {image.mode}; right would be 8 or 16 bits of grey, "
            "or 8 bits of each colour"
        )
    return np.array(image.convert("L"), np.uint8)
