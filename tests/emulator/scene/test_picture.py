import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.picture import PictureScene, load_picture


@pytest.fixture
def values() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (600, 1100), np.uint8)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.jpg"])
def test_formats(tmp_path: Path, values: np.ndarray, name: str) -> None:
    Image.fromarray(values).save(tmp_path / name, quality=100)
    pixels = load_picture(tmp_path / name)
    assert (pixels.shape, pixels.dtype) == (values.shape, np.uint8)
    assert pixels.flags.c_contiguous
    assert not pixels.flags.writeable
    np.testing.assert_allclose(pixels.astype(int), values, atol=8)


def test_crop_is_column_and_row(tmp_path: Path, values: np.ndarray) -> None:
    Image.fromarray(values).save(tmp_path / "a.png")
    part = PictureScene(tmp_path / "a.png", crop=(76, 88)).part(1000, 500)
    np.testing.assert_array_equal(part, values[88:588, 76:1076])
    assert part.flags.c_contiguous


def test_sixteen_bits_give_their_upper_eight_and_colours_their_luma(tmp_path: Path) -> None:
    wide = np.random.default_rng(2).integers(0, 1 << 16, (512, 1024), np.uint16)
    Image.fromarray(wide).save(tmp_path / "a.png")
    np.testing.assert_array_equal(load_picture(tmp_path / "a.png"), wide >> 8)
    Image.new("RGB", (1024, 512), (255, 128, 0)).save(tmp_path / "b.png")
    expected = round(0.299 * 255 + 0.587 * 128)  # ITU-R 601
    assert np.all(np.abs(load_picture(tmp_path / "b.png").astype(int) - expected) <= 1)


def test_rejects_crops_outside_the_image(tmp_path: Path) -> None:
    Image.new("L", (1024, 600)).save(tmp_path / "small.png")
    message = "small.png is 1024 x 600 pixels; with crop 0,100 it must be at least 1024 x 612"
    with pytest.raises(SceneError, match=f"^{message}$"):
        PictureScene(tmp_path / "small.png", crop=(0, 100)).part(1024, 512)
    with pytest.raises(SceneError, match="crop must be at least 0, not -1"):
        PictureScene(tmp_path / "small.png", crop=(-1, 0))


def test_wrong_formats(tmp_path: Path) -> None:
    Image.new("L", (1024, 512)).save(tmp_path / "a.bmp")
    (tmp_path / "text.png").write_text("hello")
    Image.new("F", (1024, 512)).save(tmp_path / "float.tif")
    for name, message in (
        ("a.bmp", r"a\.bmp is a BMP picture; accepted are PNG, JPEG, TIFF"),
        ("text.png", r"text\.png is not a picture; accepted are PNG, JPEG, TIFF"),
        ("float.tif", r"float\.tif has pixels of kind F; accepted are 8 or 16"),
    ):
        with pytest.raises(SceneError, match=message):
            load_picture(tmp_path / name)


def test_damaged_pictures(tmp_path: Path, values: np.ndarray) -> None:
    Image.new("L", (1024, 512), 7).save(tmp_path / "a.jpg")
    os.truncate(tmp_path / "a.jpg", (tmp_path / "a.jpg").stat().st_size // 2)
    with pytest.raises(SceneError, match=r"a\.jpg can not be read"):
        load_picture(tmp_path / "a.jpg")
    Image.fromarray(values).save(tmp_path / "a.png")
    data = bytearray((tmp_path / "a.png").read_bytes())
    second = data.index(b"IDAT", data.index(b"IDAT") + 4)
    data[second : second + 4] = b"\x00\xff\x00\xff"  # Pillow raises SyntaxError
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(SceneError, match=r"a\.png can not be read: broken PNG file"):
        load_picture(tmp_path / "a.png")


def test_larger_than_pillow_warns_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.new("L", (1024, 512)).save(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1024 * 511)
    assert load_picture(tmp_path / "a.png").shape == (512, 1024)


def test_larger_than_pillow_permits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.new("L", (1024, 512)).save(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    with pytest.raises(SceneError, match=r"a\.png can not be read: Image size .* exceeds limit"):
        load_picture(tmp_path / "a.png")
