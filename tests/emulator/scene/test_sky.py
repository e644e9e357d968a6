import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.scene.attitude import (
    attitude_error_deg,
    propagate,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.picture import PictureScene, load_picture
from cubestack.emulator.scene.sky import MOST_FALSE_STARS, Pose, SkyScene
from tests.tiers import quick


def test_truth_follows_the_rate() -> None:
    q = quaternion_from_pointing(10, 20, 30)
    scene = SkyScene(q, (0, 0.5, 0))
    assert attitude_error_deg(scene.truth(0), q) == pytest.approx((0, 0), abs=1e-12)
    assert attitude_error_deg(scene.truth(4 * 10**12), q) == pytest.approx((2.0, 0), abs=1e-9)


def test_each_pose_applies_from_its_start_time() -> None:
    first, second, third = (quaternion_from_pointing(ra, 0, 0) for ra in (0, 50, 100))
    poses = (Pose(second, at_s=1.0), Pose(third, (1.0, 0, 0), at_s=2.5))
    scene = SkyScene(first, poses=poses)
    for time_s, expected in ((1 - 1e-12, first), (1, second), (2, second)):
        np.testing.assert_allclose(scene.truth(round(time_s * 10**12)), expected)
    np.testing.assert_allclose(scene.truth(35 * 10**11), propagate(third, (1.0, 0, 0), 1.0))
    assert scene.speed_deg_s == 1.0


def test_rotated_scene_rotates_all_poses() -> None:
    q = quaternion_from_pointing(10, 20, 30)
    scene = SkyScene(q, mag_limit=3.0, poses=(Pose(q, at_s=1.0),)).rotate((0, 0, 5.0))
    for time_ps in (0, 2 * 10**12):
        assert attitude_error_deg(scene.truth(time_ps), q) == pytest.approx((0, 5.0), abs=1e-9)
    assert scene.mag_limit == 3.0


def test_false_stars_repeat_with_the_seed() -> None:
    sky = SkyScene([0, 0, 0, 1], false_stars=200, false_star_mag=(1.0, 2.0), seed=3)
    places, magnitudes = sky.false_lights()
    assert (places.shape, magnitudes.shape) == ((200, 2), (200,))
    assert 0 <= places.min() < 0.1 < 0.9 < places.max() < 1
    assert 1 < magnitudes.min() < 1.1 < 1.9 < magnitudes.max() < 2
    np.testing.assert_array_equal(sky.false_lights()[0], places)
    assert np.any(replace(sky, seed=4).false_lights()[0] != places)
    most = replace(sky, false_stars=MOST_FALSE_STARS).false_lights()[0]
    assert len(most) == MOST_FALSE_STARS
    assert np.all((most >= 0) & (most < 1))


def test_rejects_a_quaternion_of_another_length() -> None:
    with pytest.raises(SceneError, match="a quaternion has 4 numbers"):
        SkyScene([0, 0, 1])


@pytest.mark.parametrize(
    ("starts", "right"),
    [((), True), ((0.0,), True), ((1.0, 1.0, 2.0), True), ((2.0, 1.0), False), ((-0.1,), False)],
)
def test_poses_must_have_rising_start_times(starts: tuple[float, ...], right: bool) -> None:
    q = quaternion_from_pointing(10, 20, 30)
    poses = tuple(Pose(q, at_s=start_s) for start_s in starts)
    if right:
        assert SkyScene(q, poses=poses).poses == poses
        return
    with pytest.raises(SceneError, match="poses must be in order of time from 0 s on"):
        SkyScene(q, poses=poses)


@pytest.fixture
def values() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (600, 1100), np.uint8)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.jpg"])
def test_image_files_of_each_format_load(tmp_path: Path, values: np.ndarray, name: str) -> None:
    Image.fromarray(values).save(tmp_path / name, quality=100)
    pixels = load_picture(tmp_path / name)
    assert (pixels.shape, pixels.dtype) == (values.shape, np.uint8)
    assert pixels.flags.c_contiguous
    assert not pixels.flags.writeable
    np.testing.assert_allclose(pixels.astype(int), values, atol=8)


def test_crop_offset_is_column_then_row(tmp_path: Path, values: np.ndarray) -> None:
    Image.fromarray(values).save(tmp_path / "a.png")
    part = PictureScene(tmp_path / "a.png", crop=(76, 88)).part(1000, 500)
    np.testing.assert_array_equal(part, values[88:588, 76:1076])
    assert part.flags.c_contiguous


def test_image_loading_keeps_upper_8_of_16_bits_and_luma_of_colours(tmp_path: Path) -> None:
    wide = np.random.default_rng(2).integers(0, 1 << 16, (512, 1024), np.uint16)
    Image.fromarray(wide).save(tmp_path / "a.png")
    np.testing.assert_array_equal(load_picture(tmp_path / "a.png"), wide >> 8)
    Image.new("RGB", (1024, 512), (255, 128, 0)).save(tmp_path / "b.png")
    expected = round(0.299 * 255 + 0.587 * 128)  # ITU-R 601
    assert np.all(np.abs(load_picture(tmp_path / "b.png").astype(int) - expected) <= 1)


@pytest.mark.parametrize("bits", quick([12, 8, 10, 14, 16], 2))
def test_files_of_16_bits_give_the_upper_8_of_those_in_use(tmp_path: Path, bits: int) -> None:
    wide = np.random.default_rng(2).integers(0, 1 << bits, (512, 1024), np.uint16)
    for name in ("a.png", "a.tif"):
        Image.fromarray(wide).save(tmp_path / name)
        np.testing.assert_array_equal(load_picture(tmp_path / name), wide >> (bits - 8))


@pytest.mark.parametrize("orientation", quick(range(1, 9), 4))
def test_pictures_are_turned_as_their_exif_data_say(
    tmp_path: Path, values: np.ndarray, orientation: int
) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(values).save(tmp_path / "a.png", exif=exif)
    # EXIF 2.32, orientation: which sides of the scene are the file's first row and column.
    upright = values.T if orientation > 4 else values
    down, along = {2: (1, -1), 3: (-1, -1), 4: (-1, 1), 6: (1, -1), 7: (-1, -1), 8: (-1, 1)}.get(
        orientation, (1, 1)
    )
    np.testing.assert_array_equal(load_picture(tmp_path / "a.png"), upright[::down, ::along])


def test_rejects_crops_outside_the_image(tmp_path: Path) -> None:
    Image.new("L", (1024, 600)).save(tmp_path / "small.png")
    message = "small.png is 1024 x 600 pixels; with crop 0,100 it must be at least 1024 x 612"
    with pytest.raises(SceneError, match=f"^{message}$"):
        PictureScene(tmp_path / "small.png", crop=(0, 100)).part(1024, 512)
    with pytest.raises(SceneError, match="crop must be at least 0, not -1"):
        PictureScene(tmp_path / "small.png", crop=(-1, 0))


def test_unsupported_image_formats_are_rejected(tmp_path: Path) -> None:
    Image.new("L", (1024, 512)).save(tmp_path / "a.bmp")
    (tmp_path / "text.png").write_text("hello")
    Image.new("F", (1024, 512)).save(tmp_path / "float.tif")
    for name, message in (
        ("a.bmp", r"a\.bmp is not a picture that is accepted: PNG, JPEG, TIFF"),
        ("text.png", r"text\.png is not a picture that is accepted: PNG, JPEG, TIFF"),
        ("float.tif", r"float\.tif has pixels of kind F; accepted are 8 or 16"),
    ):
        with pytest.raises(SceneError, match=message):
            load_picture(tmp_path / name)


def test_damaged_image_file_raises_scene_error(tmp_path: Path, values: np.ndarray) -> None:
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


def test_pictures_of_many_pixels_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By what the file's head says, before its pixels take memory."""
    Image.new("1", (8000, 7000)).save(tmp_path / "a.png")
    words = r"^a\.png has 8000 x 7000 pixels; accepted are 50 million at most$"
    monkeypatch.setattr(Image.Image, "convert", None)
    with pytest.raises(SceneError, match=words):
        load_picture(tmp_path / "a.png")


def test_pictures_larger_than_pillow_warns_of_are_read_up_to_what_it_permits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Image.new("L", (1024, 512)).save(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1024 * 511)
    assert load_picture(tmp_path / "a.png").shape == (512, 1024)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    with pytest.raises(SceneError, match=r"a\.png can not be read: Image size .* exceeds limit"):
        load_picture(tmp_path / "a.png")
