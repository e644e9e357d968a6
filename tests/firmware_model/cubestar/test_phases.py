"""The times that telemetry PhaseTimes shows."""

import pytest

from .bench import BOOT_US, FRAME_US, Bench


def idle_us(bench: Bench) -> int:
    return int(bench.telemetry("PhaseTimes")["Idle"])


def test_idle_time_is_what_was_slept_since_the_last_capture(bench: Bench) -> None:
    bench.run(until_us=bench.now_us + 123_000)
    bench.command("CaptureImage")
    assert idle_us(bench) == pytest.approx(123_000 + BOOT_US, abs=50)
    bench.run(until_us=bench.now_us + 50_000)
    bench.command("Exposure")  # wakes the program, and is short
    bench.run(until_us=bench.now_us + 60_000)
    assert idle_us(bench) == pytest.approx(123_000 + BOOT_US, abs=50)  # of the last one, still
    bench.command("CaptureImage")
    assert idle_us(bench) == pytest.approx(110_000, abs=200)


def test_work_is_not_idle_time(bench: Bench) -> None:
    bench.command("CaptureImage")
    bench.command("TestSRAM")
    bench.command("CaptureImage")
    assert idle_us(bench) < 100


def test_a_reset_counts_as_idle_time(bench: Bench) -> None:
    bench.command("CaptureImage")
    bench.run(until_us=bench.now_us + 10_000)
    bench.command("MCUReset")
    bench.run(until_us=bench.now_us + 20_000)
    bench.command("CaptureImage")
    assert idle_us(bench) == pytest.approx(30_000 + BOOT_US, abs=200)


def test_phases_of_the_last_picture_survive_a_reset(bench: Bench) -> None:
    bench.command("CaptureImage")
    before = bench.telemetry("PhaseTimes")
    assert before["Capture"] == pytest.approx(FRAME_US, abs=10)
    bench.command("MCUReset")
    assert bench.telemetry("PhaseTimes") == before
