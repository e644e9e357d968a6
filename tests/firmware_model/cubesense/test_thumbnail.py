import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.thumbnail import OUTSIDE, frame_pixels
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


@pytest.mark.parametrize("size", ImageSize)
def test_a_frame_is_128_bytes_of_the_square(size: ImageSize, picture: NDArray[np.uint8]) -> None:
    frames = thumbnail(picture, size).reshape(-1, 128)
    assert len(frames) == size.frames
    flat = picture.ravel()
    for number in (0, size.frames // 3, size.frames // 2, size.frames - 1):
        pixels = frame_pixels(size, number)
        expected = np.where(pixels == OUTSIDE, 0, flat[pixels])
        np.testing.assert_array_equal(frames[number], expected)


@pytest.mark.parametrize("size", ImageSize)
def test_the_picture_is_read_once_and_in_sequence(size: ImageSize) -> None:
    pixels = np.concatenate([frame_pixels(size, number) for number in range(size.frames)])
    inside = pixels[pixels != OUTSIDE]
    assert (np.diff(inside) > 0).all()
    assert inside[0] == 0
    assert len(inside) == (480 // size.step) * (640 // size.step)


def test_what_does_not_exist_is_told() -> None:
    for frame in (-1, 32):
        with pytest.raises(ValueError, match=f"SIDE_64 has frames 0 to 31, not {frame}"):
            frame_pixels(ImageSize.SIDE_64, frame)
