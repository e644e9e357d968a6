import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.thumbnail import frame_pixels
from cubestack.firmware_model.interface.cubesense.codes import ImageSize

from .scenery import thumbnail


@pytest.fixture
def picture() -> NDArray[np.uint8]:
    return np.random.default_rng(3).integers(1, 256, (480, 640), np.uint8)


@pytest.mark.parametrize("size", ImageSize)
def test_the_square_is_padded_and_thinned(size: ImageSize, picture: NDArray[np.uint8]) -> None:
    canvas = np.pad(picture, ((272, 272), (192, 192)))
    assert canvas.shape == (1024, 1024)
    step = 1024 // size.side
    np.testing.assert_array_equal(thumbnail(picture, size), canvas[::step, ::step])


def test_what_does_not_exist_is_told() -> None:
    for frame in (-1, 32):
        with pytest.raises(ValueError, match=f"SIDE_64 has frames 0 to 31, not {frame}"):
            frame_pixels(ImageSize.SIDE_64, frame)
