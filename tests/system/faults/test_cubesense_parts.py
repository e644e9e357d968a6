from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, DetectResult
from cubestack.host.clients.cubesense.download import ServicePortClient
from cubestack.host.errors import NoAnswerError
from tests.system.cubesense.conftest import check_right

from .bench import Sense, line_s

X, Y = 320, 20
ADDRESS = 1024 * Y + X

UNTOUCHED = 1  # a value that no pixel of the scene has
MONITOR_MA = 200.0  # full scale of the current monitors

CUT = (CaptureResult.SRAM_OVER_CURRENT, DetectResult.NONE_SCHEDULED)


@pytest.mark.fault("memory-flip")
def test_memory_flip_changes_one_bit(quiet: Sense) -> None:
    before = quiet.host_pixel(X, Y)
    quiet.inject("memory-flip", target="nadir", address=ADDRESS, bit=5)
    for _ in range(2):
        assert quiet.host_pixel(X, Y) == before ^ 0x20
    assert quiet.host_pixel(X + 1, Y) == quiet.picture()[Y, X + 1]
    quiet.check()
    assert quiet.host_pixel(X, Y) == before


@pytest.mark.fault("memory-upsets")
def test_memory_upsets_have_their_rate_and_keep_the_fit(quiet: Sense) -> None:
    clean = quiet.picture()
    quiet.inject("memory-upsets", target="nadir", rate=1e-2)
    began_s = quiet.now_s
    quiet.check()
    expected = 1e-2 * 8 * clean.size * (quiet.now_s - began_s)
    flipped = int(np.unpackbits(quiet.picture() ^ clean).sum())
    assert 0.5 * expected < flipped < expected
    quiet.faults.clear()
    quiet.check()


@pytest.mark.fault("memory-stuck")
def test_stuck_bit_is_in_every_image(quiet: Sense) -> None:
    before = quiet.host_pixel(X, Y)
    level = 1 - (before >> 5 & 1)
    quiet.inject("memory-stuck", target="nadir", address=ADDRESS, bit=5, level=level)
    for _ in range(2):
        quiet.check()
        assert quiet.host_pixel(X, Y) == before ^ 0x20
    quiet.faults.clear()
    quiet.check()
    assert quiet.host_pixel(X, Y) == before


@pytest.mark.fault("register-flip")
def test_flipped_row_counter_shifts_the_following_rows(quiet: Sense) -> None:
    clean = quiet.picture()
    quiet.board.engine.memories["nadir"][:] = UNTOUCHED
    register = "nadir.pix_writer.counter.row"
    at_s = line_s(quiet.await_frame(), 35.5)
    quiet.faults.inject("register-flip", register=register, bit=7, at_s=at_s)
    assert quiet.outcome()[0] is CaptureResult.STORED_OWN_SRAM
    skipped = np.flatnonzero((quiet.picture() == UNTOUCHED).all(axis=1))
    assert len(skipped) == 127  # and two halves of lines
    row = int(skipped[0]) - 1
    assert row == 35
    np.testing.assert_array_equal(quiet.picture()[:row], clean[:row])
    np.testing.assert_array_equal(quiet.picture()[row + 129 :], clean[row + 1 : -128])
    assert quiet.host_pixel(X, row + 60) == UNTOUCHED
    quiet.check()


@pytest.mark.fault("register-flip")
def test_register_flips_of_an_idle_fpga_have_no_effect(quiet: Sense) -> None:
    clean = quiet.picture()
    for number in range(20):
        quiet.inject("register-flip", after_s=0.001 + number * 1e-5)
    quiet.client.pause(0.01)
    assert len(quiet.said()) == 20
    np.testing.assert_array_equal(quiet.picture(), clean)
    quiet.check()
    np.testing.assert_array_equal(quiet.picture(), clean)


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.fault("register-upsets")
def test_register_upsets_spoil_a_measurement(quiet: Sense) -> None:
    found = quiet.measure_with("register-upsets", target="fpga", rate=10)
    assert found.detect is DetectResult.BAD_FIT
    assert quiet.board.engine.violation_counts
    assert len(quiet.said()) > 100
    quiet.check()


# --- latch-up -------------------------------------------------------------------------------------


@pytest.mark.fault("latch-up")
def test_latched_up_memory_is_off_until_cleared(sense: Sense) -> None:
    sense.check()
    sense.inject("latch-up", target="SRAM2")
    assert sense.board.power.current_ma("SRAM2") > 300
    sense.client.pause(0.006)
    assert sense.board.power.current_ma("SRAM2") == 0
    power = sense.device.power()
    assert power.over_current == (False, True)
    assert power.current_sram_ma[1] == 0
    assert sense.outcome() == CUT
    other = sense.device.capture_and_detect(Camera.NADIR, codes.Sram.SRAM1)
    assert other.capture is CaptureResult.STORED_OTHER_SRAM
    check_right(other)
    sense.device.clear_over_current()
    sense.check()
    power = sense.device.power()
    assert power.over_current == (False, False)
    assert power.current_sram_ma[1] == pytest.approx(4.6, abs=0.3)


@pytest.mark.parametrize("line", [-50, 240, 1500])  # awaited, stored, searched in
@pytest.mark.fault("latch-up")
def test_latch_up_during_a_measurement_ends_it(sense: Sense, line: int) -> None:
    sense.check()
    sense.faults.inject("latch-up", target="SRAM2", at_s=line_s(sense.await_frame(), line))
    assert sense.outcome() == CUT
    assert sense.device.power().over_current == (False, True)
    sense.device.clear_over_current()
    sense.check()


@pytest.mark.fault("latch-up")
def test_lasting_latch_up_switches_off_each_time(sense: Sense) -> None:
    sense.check()
    sense.inject("latch-up", target="SRAM2", lasting=True)
    for _ in range(2):
        sense.client.pause(0.006)
        assert sense.device.power().over_current == (False, True)
        assert sense.board.power.current_ma("SRAM2") == 0
        sense.device.clear_over_current()
        sense.client.pause(0.3)
    assert sense.device.power().over_current == (False, True)
    check_right(sense.device.capture_and_detect(Camera.NADIR, codes.Sram.SRAM1))


@pytest.mark.parametrize("camera", Camera)
@pytest.mark.fault("latch-up")
def test_latched_up_camera_draws_current_until_reset(sense: Sense, camera: Camera) -> None:
    sense.check(camera)
    usual_ma = sense.device.power().current_5v_ma
    sense.inject("latch-up", target=("sun_camera", "nadir_camera")[camera])
    sense.client.pause(0.1)
    found = sense.device.power()
    assert found.over_current == (False, False)
    assert found.current_5v_ma == MONITOR_MA > usual_ma + 100
    sense.check(camera)
    sense.device.reset(codes.ResetTarget.CAMERAS)
    sense.client.pause(0.3)
    assert sense.device.power().current_5v_ma == pytest.approx(usual_ma, abs=1)
    sense.check(camera)


# --- the bench line -------------------------------------------------------------------------------


@pytest.mark.fault
@pytest.mark.parametrize("kind", ["uart-drop", "uart-corrupt", "uart-delay"])
def test_bench_line_faults_do_not_disturb_the_node_line(sense: Sense, kind: str) -> None:
    bench = ServicePortClient(sense.board.serial("bench_uart"), timeout_s=0.5)
    options: dict[str, Any] = {"delay_ms": 1000} if kind == "uart-delay" else {}
    sense.inject(kind, target="bench", direction="to-device", **options)
    with pytest.raises(NoAnswerError):
        bench.take(Camera.SUN)
    assert sense.device.serial_number()
    assert sense.flags() == set()
    sense.faults.clear()
    sense.client.pause(2.0)
    bench.take(Camera.SUN)
