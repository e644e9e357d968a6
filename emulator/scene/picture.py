"""A picture file as light: the part of a photograph that a sensor sees, in 8-bit grey values."""

import warnings
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, UnidentifiedImageError

from cubestack.emulator.scene.attitude import unit_quaternion
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.formats.untrusted import LARGEST_PICTURE, read_bytes, shown
from cubestack.firmware_model.values import DeclaredValues, positive, vector, whole

FORMATS = ("PNG", "JPEG", "TIFF")

MOST_PIXELS = 50_000_000
"""Four bytes each while a colour picture is converted."""


@dataclass(frozen=True, eq=False)
class PictureScene(DeclaredValues):
    """A picture file as the light on a sensor: PNG, JPEG or TIFF, grey or colour.

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
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked here
            image = Image.open(BytesIO(content))
            with image:
                if image.format not in FORMATS:
                    raise SceneError(
                        f"{name} is a {image.format} picture; accepted are {', '.join(FORMATS)}"
                    )
                if image.width * image.height > MOST_PIXELS:
                    raise SceneError(
                        f"{name} has {image.width} x {image.height} pixels; accepted are "
                        f"{MOST_PIXELS // 10**6} million at most"
                    )
                pixels = _grey(name, image)
    except SceneError:
        raise
    except UnidentifiedImageError:
        raise SceneError(f"{name} is not a picture; accepted are {', '.join(FORMATS)}") from None
    except Exception as error:  # damaged data can cause any error in Pillow's decoders
        raise SceneError(f"{name} can not be read: {shown(str(error))}") from None
    pixels.flags.writeable = False
    return pixels


def _grey(name: str, image: Image.Image) -> NDArray[np.uint8]:
    """8-bit grey values; colours by their luma, 16 bits by their upper 8."""
    if image.mode.startswith("I;16"):
        wide: NDArray[np.uint16] = np.asarray(image).astype(np.uint16)
        return (wide >> 8).astype(np.uint8)
    if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr"):
        raise SceneError(
            f"{name} has pixels of kind {image.mode}; accepted are 8 or 16 bits of grey, "
            "or 8 bits of each colour"
        )
    return np.array(image.convert("L"), np.uint8)
