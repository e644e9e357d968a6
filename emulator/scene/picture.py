"""A picture file as light: the part of a photograph that a sensor sees, in 8-bit grey values."""

import warnings
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.scene.attitude import unit_quaternion
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.fits import FITS_START, read_fits
from cubestack.firmware_model.formats.untrusted import LARGEST_PICTURE, read_bytes, shown
from cubestack.firmware_model.values import DeclaredValues, positive, vector, whole

if TYPE_CHECKING:
    from PIL.Image import Image

FORMATS = ("PNG", "JPEG", "TIFF")
DEPTHS = (8, 10, 12, 14, 16)
"""Bits that a file of 16 bits may use: a camera's converter often has fewer."""


MOST_PIXELS = 50_000_000
"""Four bytes each while a colour picture is converted."""


@dataclass(frozen=True, eq=False)
class PictureScene(DeclaredValues):
    """A picture file as the light on a sensor: PNG, JPEG, TIFF or FITS, grey or colour.

    Attributes:
        file: the picture.
        pixels: grey values (rows, columns) of the whole picture, read-only.
    """

    error = SceneError

    file: Path
    crop: tuple[int, int] = vector(
        2, (0, 0), "column and row of the first visible pixel", 0, kind=whole
    )
    exposure_ms: float | None = positive(
        None,
        "exposure of the picture: its light then scales with the camera's; if omitted, it does not",
    )
    quaternion: ArrayLike | None = vector(4, None, "attitude of the picture")
    pixels: NDArray[np.uint8] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.quaternion is not None:
            check_quaternion(self.quaternion)
        object.__setattr__(self, "pixels", load_picture(Path(self.file)))

    def part(self, columns: int, rows: int) -> NDArray[np.uint8]:
        """Grey values (rows, columns) that a sensor of this size sees, C-contiguous.

        Raises:
            SceneError: the picture is too small.
        """
        (x, y), (height, width) = self.crop, self.pixels.shape
        if width < x + columns or height < y + rows:
            raise SceneError(
                f"{Path(self.file).name} is {width} x {height} pixels; with crop {x},{y} it must "
                f"be at least {x + columns} x {y + rows}"
            )
        return np.ascontiguousarray(self.pixels[y : y + rows, x : x + columns])

    def truth(self, time_ps: int) -> NDArray[np.float64] | None:
        """The picture's attitude (4,) if known; the same at all times."""
        del time_ps
        return None if self.quaternion is None else unit_quaternion(self.quaternion)


def check_quaternion(quaternion: ArrayLike) -> None:
    """Raise SceneError unless ``quaternion`` is four numbers with a finite length above 0."""
    try:
        unit_quaternion(quaternion)
    except ValueError as error:
        raise SceneError(str(error)) from None


def load_picture(file: Path) -> NDArray[np.uint8]:
    """Grey values (rows, columns) of ``file``, read-only.

    Raises:
        SceneError: the file is missing, damaged, of another format, or too large.
    """
    try:
        content = read_bytes(file, LARGEST_PICTURE, SceneError)
    except OSError as error:
        raise SceneError(f"{file.name} can not be read: {error.strerror}") from None
    return decode_picture(content, file.name)


def decode_picture(content: bytes, name: str) -> NDArray[np.uint8]:
    """As ``load_picture``, from the content of the file ``name``."""
    if content.startswith(FITS_START):
        pixels = upper_bits(read_fits(content, name, MOST_PIXELS))
        pixels.flags.writeable = False
        return pixels
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked here
            image = Image.open(BytesIO(content), formats=FORMATS)
            with image:
                if image.width * image.height > MOST_PIXELS:
                    raise SceneError(
                        f"{name} has {image.width} x {image.height} pixels; accepted are "
                        f"{MOST_PIXELS // 10**6} million at most"
                    )
                # Cameras store how they were held; the sensor's light is as people see it.
                pixels = _grey(name, ImageOps.exif_transpose(image))
    except SceneError:
        raise
    except UnidentifiedImageError:
        accepted = f"{', '.join(FORMATS)} and FITS"
        raise SceneError(f"{name} is not a picture that is accepted: {accepted}") from None
    except Exception as error:  # damaged data can cause any error in Pillow's decoders
        raise SceneError(f"{name} can not be read: {shown(str(error))}") from None
    pixels.flags.writeable = False
    return pixels


def _grey(name: str, image: "Image") -> NDArray[np.uint8]:
    """8-bit grey values; colours by their luma, more bits by the upper 8 of those in use."""
    if image.mode.startswith("I;16"):
        return upper_bits(np.asarray(image).astype(np.uint16))
    if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr"):
        raise SceneError(
            f"{name} has pixels of kind {image.mode}; accepted are 8 or 16 bits of grey, "
            "or 8 bits of each colour"
        )
    return np.array(image.convert("L"), np.uint8)


def upper_bits(wide: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """The upper 8 of the bits that are in use: 8, 10, 12, 14 or 16."""
    brightest = int(wide.max(initial=0))
    bits = next(depth for depth in DEPTHS if brightest < 1 << depth)
    return np.asarray(wide >> (bits - 8), np.uint8)
