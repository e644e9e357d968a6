"""The times that telemetry PhaseTimes shows."""

import pytest

from .harness import FRAME_US, Harness


def idle_us(unit: Harness) -> int:
    return int(unit.telemetry("PhaseTimes")["Idle"])


def test_idle_time_is_what_was_slept_since_the_last_capture(unit: Harness) -> None:
    unit.run(until_us=unit.now_us + 123_000)
    unit.command("CaptureImage")
    assert idle_us(unit) == pytest.approx(123_000 + Harness.boot_us, abs=50)
    unit.run(until_us=unit.now_us + 50_000)
    unit.command("Exposure")  # wakes the program, and is short
    unit.run(until_us=unit.now_us + 60_000)
    assert idle_us(unit) == pytest.approx(
        123_000 + Harness.boot_us, abs=50
    )  # of the last one, still
    unit.command("CaptureImage")
    assert idle_us(unit) == pytest.approx(110_000, abs=200)


def test_work_is_not_idle_time(unit: Harness) -> None:
    unit.command("CaptureImage", "TestSRAM", "CaptureImage")
    assert idle_us(unit) < 100


def test_a_reset_counts_as_idle_time(unit: Harness) -> None:
    unit.command("CaptureImage")
    unit.run(until_us=unit.now_us + 10_000)
    unit.command("MCUReset")
    unit.run(until_us=unit.now_us + 20_000)
    unit.command("CaptureImage")
    assert idle_us(unit) == pytest.approx(30_000 + Harness.boot_us, abs=200)


def test_phases_of_the_last_picture_survive_a_reset(unit: Harness) -> None:
    unit.command("CaptureImage")
    before = unit.telemetry("PhaseTimes")
    assert before["Capture"] == pytest.approx(FRAME_US, abs=10)
    unit.command("MCUReset")
    assert unit.telemetry("PhaseTimes") == before
