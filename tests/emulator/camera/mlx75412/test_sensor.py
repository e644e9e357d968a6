import itertools
import logging
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.camera.mlx75412.remap import Remap
from cubestack.emulator.camera.mlx75412.sensor import Mlx75412, exposure_lines, frame_lines
from cubestack.emulator.scene.sky import PictureScene, SkyScene
from cubestack.firmware_model.interface.cameras import mlx75412 as chip

from ..conftest import segments

MS = 10**9
LINE_PS = 132_200_000
FRAME_LINES = 2918  # of the default rate register 7
ADDRESS = 0x2C


def write(camera: Mlx75412, name: str, value: int, now_ps: int = 0) -> None:
    register = chip.REGISTERS[name]
    message = register.address.to_bytes(2, "big") + value.to_bytes(register.width, "big")
    assert camera.i2c_write(ADDRESS, message, now_ps)


def configure(camera: Mlx75412, rate: int = 7, now_ps: int = 0) -> None:
    write(camera, "FRAMES_PER_SECOND", rate, now_ps)
    write(camera, "EXPOSURE_RULE", chip.LONGEST_EXPOSURE, now_ps)
    write(camera, "SYNC", chip.SYNC_APPLY, now_ps)


def enable(camera: Mlx75412, now_ps: int, on: bool = True) -> None:
    write(camera, "MODE_SELECT", 0x20 | on, now_ps)


def configured(scene: SkyScene | PictureScene | None = None, **options: Any) -> Mlx75412:
    made = Mlx75412(scene or SkyScene.pointing(80.0, 0.0), **options)
    configure(made)
    return made


@pytest.fixture
def camera() -> Mlx75412:
    return configured(seed=3)


@pytest.fixture
def photographing(striped: PictureScene) -> Mlx75412:
    """Enabled from time 0 on, in front of a picture."""
    made = configured(striped, seed=5)
    enable(made, 0)
    return made


def test_camera_acknowledges_only_its_own_address(camera: Mlx75412) -> None:
    assert not camera.i2c_write(0x2D, b"\x81\x00\x01", 0)
    assert camera.i2c_read(0x2D, 1, 0) is None
    assert not camera.enabled
    assert camera.i2c_write(ADDRESS, b"", 0)
    assert camera.i2c_write(ADDRESS, b"\x81", 0)


def test_registers_are_read_back_with_auto_increment(camera: Mlx75412) -> None:
    camera.i2c_write(ADDRESS, b"\x85\x18", 0)
    assert camera.i2c_read(ADDRESS, 6, 0) == bytes.fromhex("019BFCC00007")
    camera.i2c_write(ADDRESS, b"\x85\x00", 0)
    assert camera.i2c_read(ADDRESS, 1, 0) == b"\x00"


@pytest.mark.parametrize("how", ["power", "reset"])
def test_camera_has_no_output_without_power_or_in_reset(camera: Mlx75412, how: str) -> None:
    switch = camera.power if how == "power" else camera.set_reset_pin
    changes: list[int] = []
    camera.on_change = lambda: changes.append(1)
    switch(False, 1 * MS)
    assert (camera.running, camera.segment_at(1 * MS)) == (False, None)
    assert not camera.i2c_write(ADDRESS, b"\x81\x00\x01", 1 * MS)
    assert camera.i2c_read(ADDRESS, 1, 1 * MS) is None
    switch(True, 2 * MS + 33)
    assert camera.segment_at(2 * MS + 33).start_ps == 2 * MS + 33  # the grid starts anew
    switch(True, 3 * MS)
    assert len(changes) == 2
    camera.i2c_write(ADDRESS, b"\x85\x1c", 3 * MS)
    assert camera.i2c_read(ADDRESS, 2, 3 * MS) == b"\x00\x1e"  # reset values


def test_pixel_clock_runs_while_disabled(camera: Mlx75412) -> None:
    assert not camera.enabled
    for segment in segments(camera, 0, 3):
        assert (segment.vsync, segment.rows, segment.pixels) == (0, 0, None)
    assert camera.period == 100_000
    assert (camera.line_clocks, camera.active_columns) == (1322, 1024)


def test_mlx75412_frame_sequence_after_enable(camera: Mlx75412) -> None:
    now = 5 * MS + 12_345
    enable(camera, now)
    found = segments(camera, now, 6)
    blanking = FRAME_LINES - 512
    assert [(s.rows, s.clocks // 1322, s.vsync) for s in found] == [
        (512, 512, 1),  # undefined frame, at once
        (0, blanking, 1),  # no VSync low before the first good one
        (512, 512, 1),
        (0, blanking, 0),
        (512, 512, 1),
        (0, blanking, 0),
    ]
    assert all(s.clocks % 1322 == 0 for s in found)
    assert found[0].start_ps == 5 * MS + 100_000  # the first edge of the grid
    for before, after in itertools.pairwise(found):
        assert after.start_ps == before.start_ps + before.clocks * 100_000
    other = configured(vsync_before_first_frame=True)
    enable(other, 0)
    assert [s.vsync for s in segments(other, 0, 4)] == [1, 0, 1, 0]


def test_longest_exposure_follows_the_frame_rate(camera: Mlx75412) -> None:
    enable(camera, 0)
    shutters = [camera.frame_from(s.start_ps) for s in segments(camera, 0, 5)[2::2]]
    assert [(s.exposure_lines, s.programmed_lines) for s in shutters] == [(2917, 2917)] * 2


def test_register_values_wait_for_sync_and_the_next_frame(camera: Mlx75412) -> None:
    enable(camera, 0)
    first, blanking = segments(camera, 0, 2)
    write(camera, "EXPOSURE_RULE", 0, 10 * MS)
    write(camera, "EXPOSURE", 1000, 10 * MS)
    write(camera, "FRAMES_PER_SECOND", 9, 10 * MS)
    assert segments(camera, 20 * MS, 2)[1] == blanking
    write(camera, "SYNC", 0x01, 10 * MS)  # not the value that applies
    assert segments(camera, 20 * MS, 4)[3].clocks == blanking.clocks
    write(camera, "SYNC", chip.SYNC_APPLY, 20 * MS)
    found = segments(camera, 20 * MS, 6)
    assert found[0].start_ps == first.start_ps  # the running read-out goes on
    assert found[1].clocks == blanking.clocks  # its frame keeps its length
    assert found[3].clocks == (2269 - 512) * 1322
    shutters = [camera.frame_from(s.start_ps) for s in found if s.rows]
    # The frame that is read out next was exposed by the values at the last frame's start.
    assert [s.exposure_lines for s in shutters if s][1:] == [FRAME_LINES - 1, 1000]


def test_first_exposure_is_undefined_but_repeatable() -> None:
    def exposures(seed: int) -> list[int]:
        camera = configured(seed=seed)
        found = []
        for n in range(6):
            now = n * 1000 * MS
            enable(camera, now)
            shutter = camera.frame_from(now)
            assert shutter.programmed_lines == FRAME_LINES - 1
            found.append(shutter.exposure_lines)
            enable(camera, now + 100 * MS, on=False)
        return found

    assert (first := exposures(1)) == exposures(1) != exposures(2)
    assert len(set(first)) == 6
    assert all(1 <= lines < FRAME_LINES for lines in first)


def test_disabling_cuts_the_output_at_once(camera: Mlx75412) -> None:
    enable(camera, 0)
    segments(camera, 0, 4)  # looked ahead
    now = 30 * MS + 50
    enable(camera, now, on=False)
    rest = camera.segment_at(now)
    assert (rest.start_ps, rest.rows, rest.vsync) == (30 * MS + 100_000, 0, 0)
    assert camera.frame_from(0).readout_ps == 0
    assert camera.frame_from(1) is None  # the frames that were looked up will never be
    enable(camera, 900 * MS)
    again, following = segments(camera, 900 * MS, 2)
    assert (again.start_ps, again.rows, again.vsync) == (900 * MS, 512, 1)
    assert following.vsync == 1  # it starts with an undefined frame again
    # Two changes at one instant.
    enable(camera, 930 * MS + 1, on=False)
    enable(camera, 930 * MS + 1)
    undefined, blanking = segments(camera, 930 * MS + 1, 2)
    assert (undefined.start_ps, undefined.rows) == (930 * MS + 100_000, 512)
    assert blanking.rows == 0


def test_rewriting_the_mode_has_no_effect(camera: Mlx75412) -> None:
    changes: list[int] = []
    camera.on_change = lambda: changes.append(1)
    enable(camera, 0)
    before = segments(camera, 0, 3)
    enable(camera, 20 * MS)
    assert [s.start_ps for s in segments(camera, 20 * MS, 3)] == [s.start_ps for s in before]
    assert len(changes) == 1
    # Nor can it change after the output was planned too far.
    segments(camera, 20 * MS, 40)
    with pytest.raises(ValueError, match="its output is already planned up to"):
        enable(camera, 1 * MS, on=False)


def test_camera_with_an_odd_crystal_keeps_its_clock_grid() -> None:
    camera = configured(crystal_hz=11_000_000)
    enable(camera, 1)
    assert camera.period == Fraction(10**12, 11 * 10**6)
    for segment in segments(camera, 1, 20):
        number = round(segment.start_ps / camera.period)
        assert segment.start_ps == number * camera.period // 1
    assert camera.frame_from(0).line_ps == Fraction(1322 * 10**6, 11)


def stored(camera: Mlx75412, fpga_enable_ps: int) -> np.ndarray:
    """What a frame buffer keeps: rows from the first line's start on, VSync low starts over."""
    rows: list[np.ndarray] = []
    now = fpga_enable_ps
    while True:
        segment = camera.segment_at(now)
        if not segment.vsync:
            rows = []
        if segment.pixels is not None:
            first = max(0, -(-(now - segment.start_ps) // LINE_PS))
            rows += list(segment.pixels()[first:])
            if len(rows) >= 512:
                return np.array(rows[:512])
        now = segment.start_ps + segment.clocks * 100_000


@pytest.mark.parametrize("wait_ms", [0, 10, 40, 67])
def test_early_capture_splits_image(
    photographing: Mlx75412, striped: PictureScene, wait_ms: int
) -> None:
    scale = photographing.frame_from(0).relative_exposure
    assert abs(scale - 1) > 0.05  # else the two exposures could not be told apart
    picture = stored(photographing, wait_ms * MS)
    split = 512 - -(-wait_ms * MS // LINE_PS)  # rows of the undefined frame still to come
    assert 0 < split <= 512
    undefined = np.minimum(striped.pixels[512 - split :] * scale, 255)
    np.testing.assert_allclose(picture[:split], undefined, atol=1)
    np.testing.assert_array_equal(picture[split:], striped.pixels[: 512 - split])


@pytest.mark.parametrize("wait_ms", [70, 400], ids=["second frame", "a partial one is dropped"])
def test_wait_yields_whole_frame(
    photographing: Mlx75412, striped: PictureScene, wait_ms: int
) -> None:
    np.testing.assert_array_equal(stored(photographing, wait_ms * MS), striped.pixels)


def test_frame_from_returns_the_first_readout_at_or_after_a_time(camera: Mlx75412) -> None:
    assert camera.frame_from(0) is None
    enable(camera, 10 * MS)
    segments(camera, 10 * MS, 5)
    frame_ps = FRAME_LINES * LINE_PS
    starts = [10 * MS + number * frame_ps for number in range(3)]
    wanted = [0, starts[0], starts[0] + 1, starts[1], starts[1] + 1, starts[2]]
    found = [camera.frame_from(time_ps) for time_ps in wanted]
    assert [s.readout_ps for s in found if s] == [starts[n] for n in (0, 0, 1, 1, 2, 2)]
    assert camera.frame_from(starts[2] + 1) is None


def test_pixels_are_rendered_on_demand_and_once(camera: Mlx75412) -> None:
    enable(camera, 0)
    segment = segments(camera, 0, 3)[2]
    picture = segment.pixels()
    assert (picture.shape, picture.dtype) == ((512, 1024), np.uint8)
    assert picture.flags.c_contiguous
    assert segment.pixels() is picture
    camera.scene = SkyScene.pointing(200.0, 50.0)
    assert np.any((other := segment.pixels()) != picture)
    camera.condition = replace(camera.condition, noise=False)
    assert np.any(segment.pixels() != other)


def test_camera_feature_register_affects_the_pixels() -> None:
    warm = replace(CONDITION, temperature_c=45)
    camera = configured(SkyScene([0, 0, 0, 1], mag_limit=-5), condition=warm, seed=1)

    def mean(features: int, now_ps: int) -> float:
        write(camera, "HARDWARE_FEATURES", features, now_ps)
        write(camera, "SYNC", chip.SYNC_APPLY, now_ps)
        enable(camera, now_ps)
        segment = segments(camera, now_ps, 3)[2]
        enable(camera, segment.start_ps, on=False)
        return float(segment.pixels().mean())

    dark = chip.REGISTERS["HARDWARE_FEATURES"].field("DARK_SUBTRACTION").mask
    assert mean(0, 0) > 3  # 69 counts of 12 bits of dark signal
    assert mean(dark, 2000 * MS) < 1


def test_published_setup_logs_only_unmodelled_registers(caplog: pytest.LogCaptureFixture) -> None:
    camera = Mlx75412(SkyScene.pointing(80.0, 0.0))
    with caplog.at_level(logging.INFO):
        configure(camera)
        assert not caplog.records
        write(camera, "LINEARITY", 0)
        write(camera, "HARDWARE_FEATURES", 0x4E)
        write(camera, "FIRMWARE_FEATURES", 0xA0)
    messages = caplog.messages
    assert messages == ["MLX75412: wrote LINEARITY, which is not modelled"] * 21 + [
        "MLX75412: set AUTO_EXPOSURE of FIRMWARE_FEATURES, which is not modelled"
    ]


@pytest.mark.parametrize(
    ("hardware", "firmware", "is_on"), [(0x40, 0x80, True), (0x40, 0, False), (0, 0x80, False)]
)
def test_remap_needs_the_histogram_and_autoview(hardware: int, firmware: int, is_on: bool) -> None:
    def pixels(remap: Remap) -> np.ndarray:
        camera = Mlx75412(SkyScene.pointing(80.0, 0.0))
        camera.remap = remap
        configure(camera)
        write(camera, "HARDWARE_FEATURES", hardware)
        write(camera, "FIRMWARE_FEATURES", firmware)
        write(camera, "SYNC", chip.SYNC_APPLY)
        enable(camera, 0)
        return np.asarray(segments(camera, 0, 3)[2].pixels())

    plain, found = pixels(Remap.UPPER_BITS), pixels(Remap.EQUALIZED)
    assert (np.median(found) > 50) == is_on
    assert np.array_equal(plain, found) == (not is_on)


def test_view_sets_the_condition_and_scene_keeps_it() -> None:
    camera = Mlx75412(SkyScene([0, 0, 0, 1]))
    assert (camera.condition, camera.temperature_c) == (CONDITION, 20)
    cold = replace(CONDITION, temperature_c=-12.5)
    camera.scene = SkyView(SkyScene.pointing(1, 2), cold)
    camera.scene = other = SkyScene.pointing(3, 4)
    assert camera.scene is other
    assert (camera.condition, camera.temperature_c) == (cold, -12.5)
    assert Mlx75412(SkyView(other, cold)).temperature_c == -12.5


# CubeStar thesis, table D.2: register, expected and measured rate, approximate exposure in ms.
@pytest.mark.parametrize(
    ("register", "expected", "measured", "exposure_ms"),
    [
        (30, 11.111, 11.110, 90),
        (9, 3.333, 3.333, 300),
        (8, 2.963, 2.966, 337),
        (7, 2.593, 2.593, 386),
        (6, 2.222, 2.224, 450),
    ],
)
def test_mlx75412_has_the_published_frame_rates_and_exposures(
    register: int, expected: float, measured: float, exposure_ms: int
) -> None:
    lines = frame_lines(27_000_000, register)
    rate = 10_000_000 / (lines * chip.LINE_CLOCKS)
    assert rate == pytest.approx(expected, rel=5e-4)
    assert rate == pytest.approx(measured, rel=2e-3)
    longest = exposure_lines(chip.LONGEST_EXPOSURE, 1, lines)
    assert longest == lines - 1
    assert longest * chip.LINE_CLOCKS / 10_000 == pytest.approx(exposure_ms, abs=0.6)


def test_frame_and_exposure_lengths_in_lines_follow_the_registers() -> None:
    # The lowest rate is published, equation C.0.1: the input clock divided by 5 413 590.
    for slow in (0, 1, 4):
        assert frame_lines(27_000_000, slow) * chip.LINE_CLOCKS == 5_413_590
    # A frame is never shorter than its read-out; the clock register only scales.
    assert frame_lines(27_000_000, 60) == frame_lines(0, 7) == 520
    assert frame_lines(10_000_000, 3) == round(10_000_000 / 3 / chip.LINE_CLOCKS)
    exposures = [exposure_lines(0, lines, 700) for lines in (100, 0, 700, 65535)]
    assert exposures == [100, 1, 699, 699]
