from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.contract import PinEvent, RtlEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import rtlil_text

from .cameras import plain_camera

PERIOD = 100_000
LINE = 12
BLANK = 30
ROWS, COLUMNS = 4, 8
BOARD = cubestar_wiring()
SMALL = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))  # once, as a new one is hashed anew
for used in (BOARD, SMALL):
    rtlil_text(used.component)  # a design must be used, Amaranth says
OUTPUT_PINS = BOARD.output_pins
# The last pixel is taken by the rising edge of its own clock, stored during that clock, and
# acknowledged by the next rising edge.
FIRST_ACK = (BLANK + (ROWS - 1) * LINE + COLUMNS) * PERIOD
FRAME = (BLANK + ROWS * LINE) * PERIOD


@pytest.fixture(params=["compiled", "python"])
def engine(request):
    engine = make_engine(SMALL, request.param)
    yield engine
    engine.close()


@pytest.fixture
def camera():
    return plain_camera()


@pytest.fixture
def reading(engine):
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
    return engine


@pytest.fixture
def storing(engine, camera):
    """The engine stores from the camera's first clock on."""
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    return engine


def read(engine: RtlEngine, count: int) -> np.ndarray:
    """Switch to reading, and read ``count`` bytes at 1 MB/s."""
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
    engine.run(engine.now_ps + 50_000)
    out = np.zeros(count, np.uint8)
    assert engine.strobe_read(out, Fraction(1_000_000), engine.now_ps + count * 1_000_000) == count
    return out


def test_engine_pins_have_their_reset_levels(engine):
    levels = {name: engine.get_pin(name) for name in OUTPUT_PINS}
    active_low = {"SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"}
    assert levels == {name: int(name in active_low) for name in OUTPUT_PINS}
    assert engine.now_ps == 0
    assert engine.sram.shape == (2 * ROWS * COLUMNS,)


@pytest.mark.parametrize(
    ("bank", "enabled_ps", "frame"), [(0, 0, 0), (1, 0, 0), (0, (BLANK + 2 * LINE + 3) * PERIOD, 1)]
)
def test_stores_and_acknowledges_the_next_whole_frame(engine, camera, bank, enabled_ps, frame):
    engine.attach(camera)
    engine.run(enabled_ps)
    engine.set_pin("BANK", bank)
    engine.set_pin("ENABLE", 1)
    assert engine.run(10 * FRAME, ("ACK", 1)) == engine.now_ps == FIRST_ACK + frame * FRAME
    assert engine.get_pin("ACK") == 1
    banks = engine.sram.reshape(2, ROWS * COLUMNS)
    assert (banks[bank] == camera.images[frame].ravel()).all()
    assert not banks[1 - bank].any()
    engine.set_pin("ENABLE", 0)
    engine.set_pin("BANK", 1 - bank)
    assert not read(engine, ROWS * COLUMNS).any()
    assert not engine.violations


@pytest.mark.parametrize(("early_ps", "frame"), [(0, 1), (1, 0)])
def test_pixel_clock_edge_precedes_pin_changes_at_equal_times(engine, camera, early_ps, frame):
    """Two edges release the reset, a third must see HSYNC low: this one comes just too late."""
    engine.run((BLANK - 3) * PERIOD - early_ps)
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    assert engine.run(10 * FRAME, ("ACK", 1)) == FIRST_ACK + frame * FRAME


def test_pixel_clock_toggles_during_blanking(storing):
    for offset_ps, level in [(-1, 0), (0, 1), (PERIOD // 2 - 1, 1), (PERIOD // 2, 0)]:
        storing.run(25 * PERIOD + offset_ps)
        assert storing.get_pin("PIXCLK") == level


def test_run_without_a_stop_event_ends_on_time(storing):
    assert storing.run(FIRST_ACK - 1, ("ACK", 1)) == FIRST_ACK - 1
    assert storing.get_pin("ACK") == 0
    assert storing.run(FIRST_ACK) == FIRST_ACK
    assert storing.get_pin("ACK") == 1
    assert storing.run(2 * FRAME, ("ACK", 1)) == FIRST_ACK


def test_reading_wraps_and_needs_no_pixel_clock(storing, camera):
    storing.run(10 * FRAME, ("ACK", 1))
    storing.attach(None)
    expected = np.resize(camera.images[0], 3 * ROWS * COLUMNS)
    assert (read(storing, 3 * ROWS * COLUMNS) == expected).all()
    assert not storing.violations


def test_dead_camera_never_acknowledges(storing):
    storing.run((BLANK + 2 * LINE) * PERIOD)
    storing.attach(None)
    assert [storing.get_pin(pin) for pin in ("PIXCLK", "HSYNC", "VSYNC", "PIXDATA")] == [0] * 4
    assert storing.run(100 * FRAME, ("ACK", 1)) == 100 * FRAME
    assert storing.get_pin("ACK") == 0


def test_stored_frame_is_kept_while_the_camera_goes_on(storing, camera):
    storing.run(3 * FRAME)
    assert (storing.sram[: ROWS * COLUMNS] == camera.images[0].ravel()).all()


def test_pixels_are_rendered_only_while_they_may_be_stored(engine):
    camera = plain_camera(frames=5)
    engine.attach(camera)
    engine.run(FRAME + 1)
    assert camera.rendered == []
    engine.set_pin("ENABLE", 1)
    engine.run(10 * FRAME, ("ACK", 1))
    assert camera.rendered == [1]
    engine.run(3 * FRAME)
    engine.set_pin("RNW", 1)
    engine.run(5 * FRAME)
    assert camera.rendered == [1]


def test_changed_pixel_stream_takes_effect_immediately(engine):
    camera, other = plain_camera(seed=1), plain_camera(seed=2)
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    engine.run((BLANK - 5) * PERIOD)
    camera.segments[1].pixels = other.segments[1].pixels
    camera.segments[0].clocks += 7
    for segment in camera.segments[1:]:
        segment.start_ps += 7 * PERIOD
    engine.stream_changed()
    assert engine.run(10 * FRAME, ("ACK", 1)) == FIRST_ACK + 7 * PERIOD
    assert (engine.sram[: ROWS * COLUMNS] == other.images[0].ravel()).all()


@pytest.mark.parametrize("offset_ps", [-1, 0, 1, PERIOD // 2 - 1, PERIOD // 2, PERIOD // 2 + 1])
def test_re_reading_the_pixel_source_adds_or_loses_no_clock(storing, camera, offset_ps):
    storing.run((BLANK + LINE + 3) * PERIOD + offset_ps)
    storing.stream_changed()
    assert storing.run(10 * FRAME, ("ACK", 1)) == FIRST_ACK
    assert (storing.sram[: ROWS * COLUMNS] == camera.images[0].ravel()).all()
    assert not storing.violations


def test_camera_connected_during_a_high_clock_creates_no_edge(engine):
    engine.run(5 * PERIOD + 10)
    engine.attach(plain_camera())
    engine.run(5 * PERIOD + 20)
    assert engine.get_pin("PIXCLK") == 0
    engine.run(6 * PERIOD)
    assert engine.get_pin("PIXCLK") == 1


def test_engine_resumes_after_the_pixel_stream_stopped(engine, camera):
    segments, camera.segments = camera.segments, []
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    engine.run(5 * PERIOD)
    assert engine.get_pin("PIXCLK") == 0
    camera.segments = segments
    engine.stream_changed()
    assert engine.run(10 * FRAME, ("ACK", 1)) == FIRST_ACK


def test_strobes_keep_their_rate_over_bursts(engine):
    period = Fraction(37 * 10**12, 48_000_000)  # 770 833 1/3 ps
    out = np.zeros(7, np.uint8)
    made = sum(engine.strobe_read(out, period, 10**12) for _ in range(11))
    assert made == 77
    assert engine.now_ps == int(77 * period)


def test_strobe_read_clocks_are_on_one_time_grid(reading):
    """Told by the violations of reading too fast."""
    period = Fraction(22_001, 3)
    for count in (3, 1, 2, 5, 4):
        reading.strobe_read(np.zeros(count, np.uint8), period, 10**9)
    assert [v.time_ps for v in reading.violations] == [int(i * period) for i in range(15)]


def test_burst_after_a_pause_starts_its_own_count(engine):
    period = Fraction(1_000_001, 2)
    out = np.zeros(1, np.uint8)
    engine.strobe_read(out, period, 10**9)
    engine.run(engine.now_ps + 1)
    start = engine.now_ps
    engine.strobe_read(out, period, 10**9)
    assert engine.now_ps == start + 500_000


@pytest.mark.parametrize(("reach", "cycles"), [(-5, 0), (0, 0), (999, 0), (1000, 1), (3999, 3)])
def test_strobe_read_makes_only_cycles_that_end_in_time(engine, reach, cycles):
    out = np.zeros(9, np.uint8)
    engine.run(10_000)
    assert engine.strobe_read(out, Fraction(1000), 10_000 + reach) == cycles
    assert engine.now_ps == 10_000 + 1000 * cycles


def test_reading_faster_than_the_memory_is_a_violation(reading):
    out = np.zeros(100, np.uint8)
    reading.strobe_read(out, Fraction(11_000), 10**12)
    assert reading.violation_counts == {"read-access": 100}
    assert reading.violations[1].time_ps == 11_000
    assert reading.violations[1].address == 1
    assert len(reading.violations) == 64


def test_enable_that_cuts_a_write_pulse_is_a_violation(storing):
    fall = BLANK * PERIOD + PERIOD // 2
    storing.run(fall + 3_000)
    storing.set_pin("ENABLE", 0)
    assert [(v.kind, v.time_ps, v.address) for v in storing.violations] == [
        ("short-write-pulse", fall + 3_000, 0)
    ]


def test_apply_shows_every_output_after_every_event(engine):
    outputs = engine.apply(
        [PinEvent(10, "RNW", 1), PinEvent(20, "ENABLE", 1), PinEvent(30, "ENABLE", 0)]
    )
    by_name = [dict(zip(OUTPUT_PINS, row, strict=True)) for row in outputs.tolist()]
    assert [row["SRAM_OE_N"] for row in by_name] == [1, 0, 1]
    assert [row["SRAM_CE_N"] for row in by_name] == [1, 0, 1]
    assert engine.now_ps == 30


def test_wrong_engine_calls_name_the_cause(engine):
    engine.run(100)
    with pytest.raises(ValueError, match="run to 99 ps: the time is already 100 ps"):
        engine.run(99)
    with pytest.raises(ValueError, match="does not drive PIXCLK, only"):
        engine.set_pin("PIXCLK", 1)
    with pytest.raises(ValueError, match="no pin 'ACKK'"):
        engine.get_pin("ACKK")
    with pytest.raises(ValueError, match="stop on DATA, only on ACK"):
        engine.run(200, ("DATA", 1))
    with pytest.raises(ValueError, match="at least 2 ps"):
        engine.strobe_read(np.zeros(1, np.uint8), Fraction(1), 200)
    engine.attach(plain_camera())
    with pytest.raises(ValueError, match="does not drive PIXCLK, only"):
        engine.apply([PinEvent(300, "PIXCLK", 1)])


@pytest.mark.parametrize(
    ("field", "wrong", "found"),
    [
        ("pixels", lambda: np.zeros((4, 7), np.uint8), "shape .4, 7."),
        ("pixels", lambda: np.zeros((4, 8), np.int16), "int16"),
        ("pixels", lambda: np.zeros((8, 4), np.uint8).T, "C-contiguous"),
        ("clocks", ROWS * LINE + 1, "48 clocks, not 49"),
    ],
)
def test_engine_rejects_inconsistent_segments(storing, camera, field, wrong, found):
    setattr(camera.segments[1], field, wrong)
    with pytest.raises(ValueError, match=found):
        storing.run(FRAME)


def test_closed_compiled_engine_raises_runtime_error():
    engine = make_engine(SMALL, "compiled")
    engine.close()
    with pytest.raises(RuntimeError, match="the engine is closed"):
        engine.get_pin("ACK")
    engine.close()
