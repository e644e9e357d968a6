"""A picture file as light: the part of a photograph that a sensor sees, in 8-bit grey values."""

import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, UnidentifiedImageError

from cubestack.emulator.scene.attitude import unit_quaternion
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.values import DeclaredValues, positive, vector, whole

FORMATS = ("PNG", "JPEG", "TIFF")


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
        SceneError: the file is missing, damaged, of another format, or so large that Pillow refuses
            it.
    """
    try:
        with warnings.catch_warnings():
            # Pillow reads the picture all the same, and the file is the user's own.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(file)
        with image:
            if image.format not in FORMATS:
                raise SceneError(
                    f"{file.name} is a {image.format} picture; accepted are {', '.join(FORMATS)}"
                )
            pixels = _grey(file, image)
    except SceneError:
        raise
    except UnidentifiedImageError:
        raise SceneError(
            f"{file.name} is not a picture; accepted are {', '.join(FORMATS)}"
        ) from None
    except Exception as error:  # damaged data can cause any error in Pillow's decoders
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{file.name} can not be read: {reason}") from None
    pixels.flags.writeable = False
    return pixels


def _grey(file: Path, image: Image.Image) -> NDArray[np.uint8]:
    """8-bit grey values; colours by their luma, 16 bits by their upper 8."""
    if image.mode.startswith("I;16"):
        wide: NDArray[np.uint16] = np.asarray(image).astype(np.uint16)
        return (wide >> 8).astype(np.uint8)
    if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr"):
        raise SceneError(
            f"{file.name} has pixels of kind {image.mode}; accepted are 8 or 16 bits of grey, "
            "or 8 bits of each colour"
        )
    return np.array(image.convert("L"), np.uint8)
