import itertools
import logging
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.light import USUAL_EXPOSURE
from cubestack.emulator.camera.ov7620.sensor import Ov7620
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, Reflection
from cubestack.firmware_model.interface.cameras.ov7620 import REGISTERS, window_column, window_row

from ..conftest import US, segments, send

MS = 10**9
LINE_PS = Fraction(858 * 10**6, Fraction(27, 2))
FRAME_PS = 525 * LINE_PS
MANUAL = {"COMMON_A": 0, "COMMON_B": 0, "COMMON_I": 0x80, "COMMON_H": 0x60}


def write(camera: Ov7620, values: dict[str, int], now_ps: int = 0) -> None:
    """By the two pins, one write every 300 us."""
    for n, (name, value) in enumerate(values.items()):
        data = bytes([0x42, REGISTERS[name].address, value])
        start = now_ps + 300 * n * US
        assert send(camera.on_pin, lambda: camera.sda, data, start) == [0, 0, 0]


def quiet(scene: EarthSunScene | EarthSunView, camera: CameraTarget = CameraTarget.NADIR) -> Ov7620:
    return Ov7620(scene, camera, FisheyeCondition(noise=False))


def make(scene: EarthSunScene, camera: CameraTarget = CameraTarget.NADIR, **values: int) -> Ov7620:
    made = quiet(scene, camera)
    write(made, MANUAL | {"EXPOSURE": USUAL_EXPOSURE[camera]} | values)
    return made


def picture(camera: Ov7620, frame: int = 3) -> np.ndarray:
    """What ``frame`` sends, counted from power-up."""
    return camera.segment_at(int((frame + Fraction(1, 2)) * FRAME_PS)).pixels()


def light(camera: Ov7620, frame: int = 3) -> np.ndarray:
    return picture(camera, frame).astype(int) - 34


@pytest.fixture
def scene() -> EarthSunScene:
    return EarthSunScene(seed=4)


@pytest.fixture
def camera(scene: EarthSunScene) -> Ov7620:
    return make(scene)


def test_ov7620_frame_timing_matches_the_published_one(camera: Ov7620) -> None:
    assert float(camera.period) == pytest.approx(74_074, abs=0.1)  # "74 ns"
    assert (camera.line_clocks, camera.active_columns) == (858, 640)
    found = segments(camera, 0, 9)
    expected = [(0, 45, 1), (480, 480, 0)] * 2
    assert [(s.rows, s.clocks // 858, s.vsync) for s in found[:4]] == expected
    starts = [s.start_ps for s in found if s.rows]
    assert np.diff(starts) == pytest.approx(33.37 * MS, rel=1e-4)
    # Longer than any low HREF within a picture: the FPGA knows a frame by that.
    assert all(s.clocks > 858 for s in found if not s.rows)


def test_segments_join_without_a_gap_on_one_grid(camera: Ov7620) -> None:
    found = segments(camera, 0, 60)
    for before, after in itertools.pairwise(found):
        end = before.start_ps + int(before.clocks * camera.period)
        assert after.start_ps - end in (0, 1)
    clocks = np.cumsum([0, *(s.clocks for s in found[:-1])])
    assert [s.start_ps for s in found] == [int(k) * 10**12 // 13_500_000 for k in clocks]


def test_segment_at_any_time_contains_it(camera: Ov7620) -> None:
    for time_ps in np.random.default_rng(1).integers(0, 10**13, 300).tolist():
        segment = camera.segment_at(time_ps)
        end = segment.start_ps + int(segment.clocks * camera.period)
        assert segment.start_ps <= time_ps < end or segment.start_ps == time_ps + 1


def test_default_exposure_yields_the_published_grey_levels(scene: EarthSunScene) -> None:
    grey = picture(make(replace(scene, unevenness=0)))
    assert (grey.shape, grey.dtype) == ((480, 640), np.uint8)
    assert grey.flags.c_contiguous
    rows, columns = np.mgrid[:480, :640]
    disc = np.hypot(columns - 371, rows - 236) < 169
    assert grey[disc].mean() == pytest.approx(153, abs=1)
    assert np.median(grey[~disc]) == 34


def test_exposure_and_gain_scale_the_light(scene: EarthSunScene) -> None:
    usual = light(make(scene))
    np.testing.assert_allclose(light(make(scene, EXPOSURE=2)), usual / 2, atol=1)
    # 1.5 x 2 x 2, of an exposure of 1: the same as 1.5 times 4.
    gained = light(make(scene, EXPOSURE=1, GAIN=0x38))
    np.testing.assert_allclose(gained, np.minimum(usual * 1.5, 221), atol=1)
    least = make(scene, EXPOSURE=1)
    np.testing.assert_array_equal(picture(make(scene, EXPOSURE=0)), picture(least))
    assert least.frame_from(int(5 * FRAME_PS)).exposure_s == pytest.approx(127e-6, abs=0.2e-6)


def test_values_wait_for_the_next_frame_and_exposure_one_longer(camera: Ov7620) -> None:
    usual = light(camera, 3)
    write(camera, {"EXPOSURE": 2, "GAIN": 0x10}, int(Fraction(7, 2) * FRAME_PS))
    np.testing.assert_array_equal(light(camera, 3), usual)
    np.testing.assert_allclose(light(camera, 4), np.minimum(usual * 2, 221), atol=1)
    np.testing.assert_allclose(light(camera, 5), usual, atol=1)
    frames = [camera.frame_from(int(k * FRAME_PS)) for k in (3, 4, 5)]
    assert [frame.exposure_lines for frame in frames] == [8, 8, 4]


def test_register_change_is_announced_only_if_it_affects_announced_frames(camera: Ov7620) -> None:
    changes: list[int] = []
    camera.on_change = lambda: changes.append(1)
    camera.segment_at(5 * MS)
    write(camera, {"GAIN": 1}, 6 * MS)
    assert not changes
    segments(camera, 7 * MS, 5)
    write(camera, {"GAIN": 2}, 8 * MS)
    assert changes == [1]


def test_camera_window_registers_crop_the_frame(scene: EarthSunScene) -> None:
    whole = picture(make(scene))
    across = {"HSTART": window_column(200), "HSTOP": window_column(520)}
    camera = make(scene, **across, VSTART=window_row(100), VSTOP=window_row(340))
    found = segments(camera, int(2 * FRAME_PS), 3)
    assert [s.rows for s in found] == [0, 240, 0]
    assert camera.active_columns == 320
    assert found[1].start_ps == pytest.approx(int((2 * 525 + 45 + 100) * LINE_PS), abs=2)
    assert sum(s.clocks for s in found) == 525 * 858
    np.testing.assert_array_equal(found[1].pixels(), whole[100:340, 200:520])


@pytest.mark.parametrize(
    ("values", "shape"),
    [
        ({"HSTART": 0, "HSTOP": 0xFF, "VSTART": 0, "VSTOP": 0xFF}, (480, 640)),
        ({"HSTART": 0xFF, "VSTART": 0xFF}, (2, 4)),
        ({"HSTOP": 0, "VSTOP": 0}, (2, 4)),
    ],
)
def test_camera_window_is_kept_within_the_image(
    scene: EarthSunScene, values: dict[str, int], shape: tuple[int, int]
) -> None:
    camera = make(scene, **values)
    lines = next(s for s in segments(camera, int(2 * FRAME_PS), 3) if s.rows)
    assert lines.pixels().shape == shape == (lines.rows, camera.active_columns)


def test_mirror_bit_mirrors_the_image(scene: EarthSunScene) -> None:
    mirrored = picture(make(scene, COMMON_A=0x40))
    assert mirrored.flags.c_contiguous
    np.testing.assert_array_equal(mirrored, picture(make(scene))[:, ::-1])


def test_colour_mode_has_less_detail_from_row_to_row() -> None:
    spot = Reflection(CameraTarget.SUN, 10, 10, radius_px=1, level=150)
    scene = EarthSunScene(sun=(0, 0, 1), reflections=(spot,))
    fine, coarse = (
        light(make(scene, CameraTarget.SUN)),
        light(make(scene, CameraTarget.SUN, COMMON_H=0x20)),
    )
    assert coarse.max() < fine.max()
    np.testing.assert_allclose(coarse[:-1], (fine[:-1] + fine[1:]) / 2, atol=1)


def test_automatic_functions_after_reset_bring_the_mean_to_their_level() -> None:
    assert 85 < picture(quiet(EarthSunScene())).mean() < 110  # the brightest pixels may saturate
    assert quiet(EarthSunScene(sun=(0, 0, 1))).frame_from(100 * MS).exposure_lines == 510
    # Of 100 the black level makes 34; in steps of two of the eight lines that are usual.
    lines = quiet(EarthSunScene()).frame_from(100 * MS).exposure_lines
    assert lines == pytest.approx(8 * 66 / light(make(EarthSunScene())).mean(), abs=1)


def test_automatic_exposure_of_a_frame_does_not_depend_on_query_time() -> None:
    """Before its first row too, and without a request of the previous frame."""
    turning = EarthSunScene(rate_deg_s=(0, 900, 0), unevenness=0)
    followed = quiet(turning)
    frames = [followed.frame_from(int((k - Fraction(1, 2)) * FRAME_PS)) for k in range(1, 4)]
    assert len({frame.exposure_lines for frame in frames}) == 3
    for number, frame in enumerate(frames, 1):
        assert quiet(turning).frame_from(int(number * FRAME_PS + 10 * LINE_PS)) == frame


def test_automatic_gain_acts_on_a_fixed_exposure(scene: EarthSunScene) -> None:
    fixed = {"COMMON_A": 0x20, "COMMON_B": 1, "COMMON_I": 0x80, "EXPOSURE": 4}
    low = picture(make(scene, **fixed)).mean()
    assert low > picture(make(scene)).mean() + 10
    # Its gain takes the place of the register's.
    assert picture(make(scene, **fixed, GAIN=0x3F)).mean() == low
    # Without its own bit it does not act.
    assert picture(make(scene, **fixed | {"COMMON_A": 0})).mean() == picture(make(scene)).mean()


def test_reset_bit_restores_the_registers_and_itself(scene: EarthSunScene) -> None:
    fresh = picture(quiet(scene), 9)
    camera = make(scene, GAIN=0x3F)
    assert np.any(picture(camera, 3) != fresh)
    write(camera, {"COMMON_A": 0x80}, int(4 * FRAME_PS))
    np.testing.assert_array_equal(picture(camera, 9), fresh)
    write(camera, MANUAL | {"EXPOSURE": 4}, int(10 * FRAME_PS))
    np.testing.assert_array_equal(picture(camera, 15), picture(make(scene)))


def test_logs_unimplemented_addresses(camera: Ov7620, caplog: pytest.LogCaptureFixture) -> None:
    before = picture(camera)
    with caplog.at_level(logging.INFO):
        caplog.clear()
        send(camera.on_pin, lambda: camera.sda, b"\x42\x7f\x12", 40 * MS)
        write(camera, {"SATURATION": 0x11, "COMMON_C": 0x24}, 50 * MS)
    np.testing.assert_array_equal(picture(camera), before)
    assert caplog.messages == [
        "OV7620: wrote 0x12 to 0x007f, where no register is known",
        "OV7620: wrote SATURATION, which is not modelled",
        "OV7620: wrote COMMON_C, which is not modelled",
    ]


def test_camera_has_no_output_without_power(scene: EarthSunScene) -> None:
    camera = make(scene)
    changes: list[int] = []
    camera.on_change = lambda: changes.append(1)
    camera.power(False, 100 * MS)
    camera.power(False, 100 * MS)
    assert (camera.running, camera.segment_at(100 * MS)) == (False, None)
    assert send(camera.on_pin, lambda: camera.sda, b"\x42\x00\x01", 110 * MS) == [1, 1, 1]
    camera.power(True, 200 * MS + 7)
    assert len(changes) == 2
    segment = camera.segment_at(200 * MS + 7)
    assert segment.start_ps == 200 * MS + 7  # the grid starts anew, with reset values
    lines = camera.segment_at(segment.start_ps + int(50 * LINE_PS))
    np.testing.assert_array_equal(lines.pixels(), picture(quiet(scene), 0))


def test_frame_from_returns_the_next_readout(camera: Ov7620) -> None:
    first_row = int(45 * LINE_PS)
    for frame in (0, 1, 7):
        readout = int(frame * FRAME_PS) + first_row
        for earlier in (2, int(FRAME_PS) - 3):
            shutter = camera.frame_from(max(0, readout - earlier))
            assert shutter.readout_ps == pytest.approx(readout, abs=1)
            assert shutter.line_ps == LINE_PS


def test_image_shows_the_scene_at_mid_exposure_of_the_middle_row() -> None:
    turning = EarthSunScene(rate_deg_s=(0, 30.0, 0), unevenness=0)
    camera = make(turning, EXPOSURE=200)
    tilt = 30.0 * camera.frame_from(int(3 * FRAME_PS)).mid_exposure_ps(239.5) / 10**12
    still = EarthSunScene.facing(nadir_deg=(-tilt, 0), unevenness=0)
    expected = picture(make(replace(still, sun=-np.asarray(still.nadir)), EXPOSURE=200))
    assert np.mean(picture(camera) != expected) < 0.01


def test_image_is_rendered_once_and_noise_is_per_frame(scene: EarthSunScene) -> None:
    def noisy(seed: int) -> Ov7620:
        return make(EarthSunView(scene, FisheyeCondition(seed=seed, hot_pixels=9)))

    camera = noisy(1)
    one = picture(camera, 3)
    assert picture(camera, 3) is one
    assert np.any(picture(camera, 4) != one)
    np.testing.assert_array_equal(picture(camera, 3), one)  # rendered anew
    np.testing.assert_array_equal(picture(noisy(1), 3), one)
    assert np.any(picture(noisy(2), 3) != one)
    hot = np.flatnonzero(one == 255)
    assert hot.size == 9
    assert np.all(picture(camera, 4).ravel()[hot] == 255)


def test_rejects_reflection_outside_the_field(scene: EarthSunScene) -> None:
    far = Reflection(CameraTarget.SUN, 90, 90, radius_px=1, level=1)
    with pytest.raises(ValueError, match="at_deg must be within 95"):
        make(replace(scene, reflections=(far,)))
    with pytest.raises(TypeError, match="nadir sensor is Earth and Sun, not 3"):
        make(scene).scene = 3


def test_a_new_scene_is_seen_by_the_next_picture(scene: EarthSunScene) -> None:
    camera = make(scene)
    assert picture(camera).max() > 150
    camera.scene = replace(scene, sun=(0, 0, 1))
    assert picture(camera).max() < 40
