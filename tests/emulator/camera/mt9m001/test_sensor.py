"""Timing against the data sheet's formulas, the window and gain against an ideal picture."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412 import lens as other_lens
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION, double_gauss
from cubestack.emulator.camera.mt9m001.registers import GAINS, SensorSettings, read_settings
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.scene.atmosphere import Atmosphere
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S
from cubestack.firmware_model.interface.cameras import mt9m001 as chip

ADDRESS = chip.REGISTERS.i2c_address
ROW_CLOCKS = 1524
ROW_S = ROW_CLOCKS / chip.PIXEL_CLOCK_HZ
QUIET = replace(CONDITION, noise=False)


def scene(**changes: object) -> SkyScene:
    return replace(SkyScene.pointing(84.0, -1.0), **changes)


@pytest.fixture
def camera() -> Mt9m001:
    return Mt9m001(scene())


def put(camera: Mt9m001, name: str, *words: int, now_ps: int = 0) -> None:
    data = b"".join(word.to_bytes(2, "big") for word in words)
    assert camera.i2c_write(ADDRESS, bytes([chip.REGISTERS[name].address]) + data, now_ps)


def get(camera: Mt9m001, name: str) -> int:
    assert camera.i2c_write(ADDRESS, bytes([chip.REGISTERS[name].address]), 0)
    answer = camera.i2c_read(ADDRESS, 2, 0)
    return int.from_bytes(answer, "big")


def starts(segments: list[tuple[int, int, int, int]]) -> list[int]:
    return [start for start, clocks, *_ in segments if clocks == 242]


def stream(camera: Mt9m001, start_ps: int, until_ps: int) -> list[tuple[int, int, int, int]]:
    segments, now = [], start_ps
    while now < until_ps:
        segment = camera.segment_at(now)
        segments.append((segment.start_ps, segment.clocks, segment.vsync, segment.rows))
        now = segment.start_ps + int(segment.clocks * camera.period)
    return segments


def frame(camera: Mt9m001, after_ps: int) -> np.ndarray:
    pieces, now, low = [], after_ps, False
    while len(pieces) < 2:
        segment = camera.segment_at(now)
        low |= not segment.vsync
        if low and segment.pixels is not None:
            pieces.append(segment.pixels())
        now = segment.start_ps + int(segment.clocks * camera.period)
    return np.concatenate(pieces)


def test_default_frames_follow_the_data_sheet(camera: Mt9m001) -> None:
    segments = stream(camera, 0, 100 * PS_PER_MS)
    first = next(i for i, s in enumerate(segments) if s[2])
    assert [s[1:] for s in segments[first : first + 4]] == [
        (242, 1, 0),
        (1023 * ROW_CLOCKS, 1, 1023),
        (1282, 1, 1),  # the last line ends 2 clocks after its pixels
        (26 * ROW_CLOCKS, 0, 0),
    ]
    begun = starts(segments)
    assert np.diff(begun) == pytest.approx(1050 * ROW_S * PS_PER_S)
    assert begun[0] == pytest.approx(1050 * ROW_S * PS_PER_S)  # one exposure and a row


@pytest.mark.parametrize(
    ("shutter", "rows"), [(100, 1050), (1049, 1050), (1050, 1051), (6299, 6300)]
)
def test_exposure_longer_than_the_frame_lengthens_the_frame(
    camera: Mt9m001, shutter: int, rows: int
) -> None:
    put(camera, "SHUTTER_WIDTH", shutter)
    segments = stream(camera, 0, PS_PER_S)
    for (start, clocks, *_), (following, *_) in pairwise(segments):
        assert following - (start + clocks * PS_PER_S // chip.PIXEL_CLOCK_HZ) in (0, 1)
    *_, last = begun = starts(segments)
    assert np.diff(begun) == pytest.approx(rows * ROW_S * PS_PER_S)
    exposure = camera.frame_from(last)
    assert exposure.exposure_s == pytest.approx(shutter * ROW_S)
    assert exposure.readout_ps == pytest.approx(last + 242 / chip.PIXEL_CLOCK_HZ * PS_PER_S, abs=1)


@pytest.mark.parametrize(
    ("change_ms", "read_out", "counts_from_s"),
    [
        (50, 1, (1050 + 1024) * ROW_S),  # in the read-out of the first frame, which goes on
        (66.2, 0, 0.0662),  # that frame ended at 65.85 ms, the next is due at 66.68
    ],
)
def test_no_frame_mixes_two_exposures(
    camera: Mt9m001, change_ms: float, read_out: int, counts_from_s: float
) -> None:
    change = round(change_ms * PS_PER_MS)
    stream(camera, 0, change)
    put(camera, "SHUTTER_WIDTH", 3000, now_ps=change)
    segments = stream(camera, change, PS_PER_S)
    assert segments[0][2] == read_out
    first = starts(segments)[0] / PS_PER_S
    assert first == pytest.approx(counts_from_s + 3001 * ROW_S, abs=1e-7)


@pytest.mark.parametrize(("clocks", "counts"), [(-1, True), (0, True), (1, False), (300, False)])
def test_gain_applies_from_the_next_frame(camera: Mt9m001, clocks: int, counts: bool) -> None:
    begins = starts(stream(camera, 0, 200 * PS_PER_MS))[1]
    bright = Atmosphere(-1.0, 84.0, sky_mag=12.0)
    camera = Mt9m001(SkyView(scene(mag_limit=-5.0, atmosphere=bright), QUIET))
    write_ps = begins + clocks * PS_PER_S // chip.PIXEL_CLOCK_HZ
    stream(camera, 0, write_ps)
    put(camera, "GLOBAL_GAIN", 0x67, now_ps=write_ps)
    lines = camera.segment_at(begins + 10 * PS_PER_MS)
    assert lines.start_ps == pytest.approx(begins + 242 * PS_PER_S / chip.PIXEL_CLOCK_HZ, abs=1)
    assert bool(lines.pixels().max() > 200) is counts


def test_register_changes_wait_while_synchronised_changes_are_on(camera: Mt9m001) -> None:
    put(camera, "OUTPUT_CONTROL", 0b11)
    put(camera, "SHUTTER_WIDTH", 2000)
    put(camera, "GLOBAL_GAIN", 0x20)
    assert camera.frame_from(0).exposure_lines == 1049
    put(camera, "OUTPUT_CONTROL", 0b10)
    assert camera.frame_from(0).exposure_lines == 2000


def test_camera_registers_have_reset_values_and_access_rights(camera: Mt9m001) -> None:
    for register in chip.REGISTERS:
        assert get(camera, register.name) == register.reset, register.name
    put(camera, "GLOBAL_GAIN", 0x51)
    assert {get(camera, name) for name in GAINS} == {0x51}
    put(camera, "CHIP_VERSION", 1)  # read-only
    assert get(camera, "CHIP_VERSION") == 0x8431
    put(camera, "CHIP_ENABLE", 0)
    assert get(camera, "OUTPUT_CONTROL") == 0
    assert not camera.enabled
    put(camera, "OUTPUT_CONTROL", 2)
    assert get(camera, "CHIP_ENABLE") == 1
    put(camera, "RESET", 1)
    assert get(camera, "GLOBAL_GAIN") == 8
    assert not camera.enabled
    put(camera, "RESET", 0)
    assert camera.enabled


def test_camera_i2c_supports_bursts_and_half_words_and_ignores_others(camera: Mt9m001) -> None:
    put(camera, "ROW_START", 20, 40, 255, 639)
    names = ("ROW_START", "COLUMN_START", "ROW_SIZE", "COLUMN_SIZE")
    assert [get(camera, name) for name in names] == [20, 40, 255, 639]
    assert camera.i2c_write(ADDRESS, b"\x09\x12", 0)
    assert get(camera, "SHUTTER_WIDTH") == 0x0419
    assert camera.i2c_write(ADDRESS, b"", 0)
    assert not camera.i2c_write(0x2C, b"\x09\x00\x01", 0)
    assert camera.i2c_read(0x2C, 2, 0) is None


def test_camera_is_silent_without_power_or_in_reset(camera: Mt9m001) -> None:
    put(camera, "SHUTTER_WIDTH", 77)
    for switch in (camera.power, camera.set_reset_pin):
        switch(False, 10)
        assert camera.segment_at(20) is camera.frame_from(20) is None
        assert not camera.i2c_write(ADDRESS, b"\x00", 20)
        switch(True, 30)
        assert get(camera, "SHUTTER_WIDTH") == 0x0419


def test_stop_ends_the_frame_and_start_begins_an_exposure(camera: Mt9m001) -> None:
    changes: list[int] = []
    camera.on_change = lambda: changes.append(1)
    stop, start = 40 * PS_PER_MS, 90 * PS_PER_MS
    assert camera.segment_at(stop).vsync == 1
    put(camera, "OUTPUT_CONTROL", 0, now_ps=stop)
    assert changes
    assert all(s[2:] == (0, 0) for s in stream(camera, stop, start))
    put(camera, "OUTPUT_CONTROL", 2, now_ps=start)
    exposed_ps = 1050 * ROW_S * PS_PER_S
    first = starts(stream(camera, start, 200 * PS_PER_MS))[0]
    assert first == pytest.approx(start + exposed_ps, rel=1e-6)
    put(camera, "RESTART", 1, now_ps=250 * PS_PER_MS)
    first = starts(stream(camera, 250 * PS_PER_MS, 350 * PS_PER_MS))[0]
    assert first == pytest.approx(250 * PS_PER_MS + exposed_ps, rel=1e-6)


def test_windowed_frame_equals_that_part_of_the_full_frame() -> None:
    def taken(shutter: int, *window: int) -> np.ndarray:
        made = Mt9m001(SkyView(scene(), QUIET))
        put(made, "ROW_START", *window)
        put(made, "SHUTTER_WIDTH", shutter)
        return frame(made, 0)

    whole = taken(6000)
    assert whole.shape == (chip.ROWS, chip.COLUMNS)
    small = taken(12_000, 12 + 300, 20 + 200, 399, 517)  # lines of half the length
    np.testing.assert_array_equal(small, whole[300:700, 200:718])
    picture = taken(12_000, 2, 10, 99, 517)  # ten rows and ten columns before the active ones
    np.testing.assert_array_equal(picture[10:, 10:], whole[:90, :508])
    assert (picture[:10] == 1).all()


def test_gain_scales_pixels_and_can_differ_by_row_and_column() -> None:
    camera = Mt9m001(scene(mag_limit=-5.0), condition=QUIET)
    assert np.unique(frame(camera, 0)).tolist() == [2]  # the black level, rounded
    bright = Mt9m001(scene(), condition=replace(QUIET, optics=double_gauss(spot_sigma_px=4)))
    put(bright, "SHUTTER_WIDTH", 6000)
    once = frame(bright, 0).astype(int) - 1.5
    put(bright, "GLOBAL_GAIN", chip.gain_register(8.0), now_ps=PS_PER_S)
    eight = frame(bright, PS_PER_S).astype(int) - 1.5
    clear = (eight < 250) & (once > 5)
    assert clear.any()
    assert np.median(eight[clear] / once[clear]) == pytest.approx(8, rel=0.1)
    put(bright, "RED_GAIN", chip.gain_register(1.0), now_ps=2 * PS_PER_S)
    mixed = frame(bright, 2 * PS_PER_S).astype(int) - 1.5
    np.testing.assert_array_equal(mixed[0::2, 1::2], once[0::2, 1::2])
    np.testing.assert_array_equal(mixed[1::2, 1::2], eight[1::2, 1::2])


def test_frames_repeat_with_the_same_seed_and_differ_in_time() -> None:
    one, two, other = (Mt9m001(scene(), condition=replace(CONDITION, seed=n)) for n in (5, 5, 6))
    np.testing.assert_array_equal(frame(one, 0), frame(two, 0))
    assert (frame(one, 0) != frame(one, PS_PER_S)).any()
    assert (frame(one, 0) != frame(other, 0)).any()


def test_rejects_foreign_lens_and_scene_without_sky() -> None:
    with pytest.raises(ValueError, match="1280 x 1024 pixels, but the lens is for 1024 x 512"):
        Mt9m001(scene(), condition=other_lens.CONDITION)
    camera = Mt9m001(scene())
    with pytest.raises(ValueError, match="the lens is for 1024 x 512"):
        camera.condition = other_lens.CONDITION
    with pytest.raises(TypeError, match="a star tracker's scene is a sky or a picture, not 3"):
        camera.scene = 3
    assert camera.condition is CONDITION


def test_rotating_camera_smears_stars_along_its_motion() -> None:
    """At 10 deg/s across, 10 ms of exposure draw 4.7 px."""
    turning = scene(rate_deg_s=(0.0, 10.0, 0.0), mag_limit=4.5)

    def spread(sky: SkyScene) -> tuple[float, float]:
        """Variances of the brightest star along the columns and along the rows, px^2."""
        camera = Mt9m001(sky, condition=QUIET)
        put(camera, "SHUTTER_WIDTH", 315)
        put(camera, "GLOBAL_GAIN", chip.gain_register(4.0))
        picture = frame(camera, 0)
        row, column = divmod(int(np.argmax(picture)), chip.COLUMNS)
        around = picture[row - 12 : row + 13, column - 12 : column + 13].astype(float) - 2
        y, x = np.mgrid[:25, :25]
        means = [np.average(axis, weights=around) for axis in (x, y)]
        return tuple(
            float(np.average((axis - mean) ** 2, weights=around))
            for axis, mean in zip((x, y), means, strict=True)
        )

    wide, high = spread(turning)
    round_wide, round_high = spread(scene(mag_limit=4.5))
    assert round_wide == pytest.approx(round_high, rel=0.1)
    streak_px = 10 * 315 * ROW_S * np.radians(1) * 2692.34
    assert wide - high == pytest.approx(streak_px**2 / 12, rel=0.2)


def test_rows_of_a_window_have_their_own_exposure_times() -> None:
    turning = scene(rate_deg_s=(0.0, 5.0, 0.0), mag_limit=5.0)
    whole = replace(read_settings(RegisterFile(chip.REGISTERS)), gains=(4.0, 4.0, 4.0, 4.0))
    first_ps, line_ps = 2 * 10**11, Fraction(31_750_000)

    def picture(readout_ps: int, settings: SensorSettings) -> np.ndarray:
        shutter = RollingShutter(readout_ps, line_ps, 1000, 1000)
        return Mt9m001Imager().render(turning, QUIET, shutter, settings)

    part = picture(first_ps, whole)[600:900]
    window = replace(whole, row=600, rows=300)
    np.testing.assert_array_equal(picture(first_ps + int(600 * line_ps), window), part)
    assert (picture(first_ps, window) != part).any()
