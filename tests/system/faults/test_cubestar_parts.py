import numpy as np
import pytest

from cubestack.firmware_model.interface.cameras.mlx75412 import CRYSTAL_HZ, LINE_CLOCKS

from .bench import GOOD, ONE_FRAME_MS, READING_S, STORING_S, Star

ADDRESS = 70_000
STORED_S = 0.47  # between the FPGA's last write and the processor's first read


def check_flipped(star: Star, good: np.ndarray, mask: int) -> None:
    """Bits ``mask`` of one byte differ, in the processor's memory and for the host."""
    expected = good.ravel().copy()
    expected[ADDRESS] ^= mask
    np.testing.assert_array_equal(star.transferred.ravel(), expected)
    number, at = divmod(ADDRESS, 128)
    assert star.block(number)[at] == expected[ADDRESS]


@pytest.mark.fault("memory-flip")
def test_memory_flip_of_the_fpga_changes_one_bit(star: Star, good: np.ndarray) -> None:
    star.faults.inject("memory-flip", address=ADDRESS, bit=7, at_s=STORED_S)
    assert star.capture() == GOOD
    check_flipped(star, good, 0x80)


@pytest.mark.fault("memory-flip")
def test_memory_flip_of_the_processor_changes_one_bit(star: Star, good: np.ndarray) -> None:
    assert star.capture() == GOOD
    star.inject("memory-flip", target="external", address=ADDRESS, bit=5)
    check_flipped(star, good, 0x20)
    assert star.device.process_image().name == "CALCULATED"
    assert star.flags() == set()


@pytest.mark.parametrize("target", ["SRAM", "external"])
@pytest.mark.fault("memory-upsets")
def test_memory_upsets_set_no_flag(star: Star, good: np.ndarray, target: str) -> None:
    star.inject("memory-upsets", target=target, rate=1e-3)
    assert star.capture()[0] == "CALCULATED"
    star.faults.clear()
    flipped = int(np.unpackbits(star.transferred ^ good).sum())
    assert 500 < flipped < 8000
    assert star.flags() == set()


@pytest.mark.fault("memory-upsets")
def test_memory_upsets_have_their_rate(star: Star) -> None:
    memory = star.board.engine.sram
    before, began_s = memory.copy(), star.now_s
    star.inject("memory-upsets", rate=1e-4)
    star.client.pause(1.0)
    expected = 1e-4 * 8 * memory.size * (star.now_s - began_s)
    flipped = int(np.unpackbits(memory ^ before).sum())
    assert abs(flipped - expected) < 5 * np.sqrt(expected)


@pytest.mark.parametrize("target", ["SRAM", "external"])
@pytest.mark.fault("memory-stuck")
def test_stuck_bit_is_in_every_image(star: Star, good: np.ndarray, target: str) -> None:
    star.inject("memory-stuck", target=target, address=ADDRESS, bit=7)
    assert star.capture() == GOOD
    check_flipped(star, good, 0x80)
    star.capture()
    assert star.transferred.ravel()[ADDRESS] & 0x80
    star.faults.clear()
    star.capture()
    assert not star.transferred.ravel()[ADDRESS] & 0x80


@pytest.mark.fault("register-flip")
def test_flipped_row_counter_shifts_the_following_rows(star: Star, good: np.ndarray) -> None:
    star.faults.inject("register-flip", register="writer.counter.row", bit=8, at_s=STORING_S)
    status, flags = star.capture()
    assert status != "CAPTURE_FAILED"
    assert flags <= {"MaxInvalidStarsDetectionError"}  # of memory that nothing was written to
    row = int(np.argmax((star.stored != good).any(axis=1)))
    assert 0 < row < 256
    np.testing.assert_array_equal(star.stored[:row], good[:row])
    np.testing.assert_array_equal(star.stored[row + 257 :], good[row + 1 : 256])
    lines_ms = 256 * LINE_CLOCKS * 1000 / CRYSTAL_HZ
    assert star.stored_for_ms == pytest.approx(ONE_FRAME_MS - lines_ms, abs=1)
    number = 8 * (row + 300)
    np.testing.assert_array_equal(star.block(number), good.reshape(-1, 128)[number - 8 * 256])
    assert star.capture()[0] == "CALCULATED"
    assert star.stored_for_ms == pytest.approx(ONE_FRAME_MS, abs=10)


@pytest.mark.fault("register-flip")
def test_register_flips_of_an_idle_fpga_have_no_effect(star: Star, good: np.ndarray) -> None:
    for number in range(20):
        star.faults.inject("register-flip", at_s=0.01 + number * 1e-5)
    assert star.capture() == GOOD
    assert len(star.said()) == 20
    np.testing.assert_array_equal(star.stored, good)


@pytest.mark.parametrize("profile", ["extended"])
@pytest.mark.fault("register-upsets")
def test_register_upsets_spoil_an_image(star: Star, good: np.ndarray) -> None:
    status, flags = star.capture_with("register-upsets", rate=10)
    assert len(star.faults.log) > 100
    assert status in ("IDENTIFICATION_FAILED", "DETECTION_FAILED")
    assert flags & {"LessThanThreeStarsID", "LessThanThreeStarsDetected", "IDError"}
    assert (star.stored != good).mean() > 0.1
    assert star.board.engine.violation_counts
    assert star.capture()[0] == "CALCULATED"


# --- latch-up -------------------------------------------------------------------------------------


@pytest.mark.parametrize("channel", ["imager", "memory"])
@pytest.mark.fault("latch-up")
def test_latch_up_is_switched_off_and_restored(star: Star, channel: str) -> None:
    power, currents = star.board.power, []
    switched = power.on_switch

    def watch(name: str, on: bool) -> None:
        currents.append((name, on, power.current_ma(name)))
        switched(name, on)

    power.on_switch = watch
    star.client.pause(0.05)
    star.inject("latch-up", target=channel)
    assert power.current_ma(channel) > 300
    star.client.pause(1e-5)
    assert currents == [(channel, False, 0.0)]
    star.client.pause(0.2)
    assert currents[1][:2] == (channel, True)
    assert currents[1][2] < 100
    assert star.flags() == {"OverCurrent"}
    assert star.capture() == ("CALCULATED", {"OverCurrent"})


@pytest.mark.parametrize("at_s", [STORING_S, READING_S])
@pytest.mark.parametrize("channel", ["imager", "memory"])
@pytest.mark.fault("latch-up")
def test_latch_up_during_a_capture_loses_the_image(star: Star, channel: str, at_s: float) -> None:
    star.faults.inject("latch-up", target=channel, at_s=at_s)
    silent = (channel, at_s) == ("imager", STORING_S)  # ACK is waited for in vain
    more = {"ISDisableError"} if silent else set()
    assert star.capture() == ("CAPTURE_FAILED", {"OverCurrent", "ImageCaptureError"} | more)
    assert (star.stored_for_ms > 2000) is silent
    assert star.capture()[0] == "CALCULATED"


@pytest.mark.fault("latch-up")
def test_persistent_latch_up_keeps_the_imager_off(star: Star) -> None:
    star.inject("latch-up", target="imager", lasting=True)
    assert star.capture() == ("CAPTURE_FAILED", {"OverCurrent", "ISSetupError"})
    assert star.telemetry("Identification")
    assert star.board.power.current_ma("imager") < 1
