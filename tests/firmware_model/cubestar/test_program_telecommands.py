"""Telecommands while the 1 Hz loop runs."""

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.program import ITERATION_US, RESET_LEAD_US
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE, TaskStatus

from .bench import BOOT_US, Bench
from .sky import Sky

# --- telecommands meanwhile -----------------------------------------------------------------------


def test_telecommands_are_served_in_the_idle_time(bench: Bench) -> None:
    start_us = bench.start_loop(1.5)  # in the middle of a capture
    bench.send("Exposure", exposure=77)
    assert bench.telemetry("TcmdProcessed")["Processed"] == 0
    bench.run(until_us=start_us + 1_980_000)
    assert bench.telemetry("TcmdProcessed")["Processed"] == 1
    assert bench.telemetry("Exposure")["exposure"] == 77
    bench.run(until_us=start_us + 2_900_000)
    assert bench.camera_value("EXPOSURE") == 77
    assert "TimingError" not in bench.flags()


def test_a_telecommand_that_comes_just_before_the_reset_is_not_lost(bench: Bench) -> None:
    start_us = bench.start_loop(0.5)
    for number, early_us in enumerate((200, 20, 2, 1), start=1):
        bench.run(until_us=start_us + number * ITERATION_US - RESET_LEAD_US - early_us)
        assert bench.send("Exposure", exposure=number) == 0
        bench.run(until_us=start_us + number * ITERATION_US + 300_000)
        assert bench.telemetry("Exposure")["exposure"] == number
    assert len(bench.resets) == 4


def test_a_frame_that_straddles_the_reset_is_not_lost(bench: Bench) -> None:
    start_us = bench.start_loop(0.5)
    message = INTERFACE.telecommand("Exposure")
    frame = encode_frame(bytes([message.id]) + message.pack(exposure=6))
    bench.run(until_us=start_us + ITERATION_US - RESET_LEAD_US - 50)
    assert bench.uart(frame[:4]) == []
    bench.run(until_us=start_us + ITERATION_US - 100)
    assert bench.resets == []
    assert bench.uart(frame[4:]) == [b"\0"]
    bench.run(until_us=start_us + 2 * ITERATION_US)
    assert bench.telemetry("Exposure")["exposure"] == 6
    assert len(bench.resets) == 1  # the next iteration resets again
    assert np.diff(bench.stored_us()[1:]) == pytest.approx(ITERATION_US, abs=100)


def test_an_i2c_transfer_across_the_reset_keeps_its_answer(bench: Bench) -> None:
    start_us = bench.start_loop(0.5)
    link = bench.program.link
    bench.run(until_us=start_us + ITERATION_US - RESET_LEAD_US - 50)
    link.i2c_start(False)
    link.i2c_write(156)
    bench.run(until_us=start_us + ITERATION_US + 100_000)
    assert bench.program.link is link
    link.i2c_start(True)
    assert link.i2c_read() == 10
    link.i2c_stop()


def test_a_long_telecommand_makes_the_next_iteration_late(bench: Bench) -> None:
    start_us = bench.start_loop(0.9)
    bench.send("CaptureAndProcess")
    bench.run(until_us=start_us + 1_500_000)
    assert bench.telemetry("LoopStatus")["Iterations"] == 1
    bench.run(until_us=start_us + 6_500_000)
    assert bench.flags() == {"TimingError", "LessThanThreeStarsDetected"}
    times = bench.stored_us()
    assert times[2] - times[0] > ITERATION_US + 500_000
    assert np.diff(times[2:]) == pytest.approx(ITERATION_US, abs=100)  # in step again


def test_an_iteration_that_takes_too_long(bench: Bench) -> None:
    bench.command("SetDiscardDelay", Delay=600)  # 600 + 386 + 404 ms
    start_us = bench.start_loop(1.0)
    assert "TimingError" not in bench.flags()
    bench.run(until_us=start_us + 8_000_000)
    assert "TimingError" in bench.flags()
    assert np.diff(bench.stored_us()[1:]) == pytest.approx(1_390_000 + BOOT_US, abs=10_000)
    assert bench.telemetry("StartAndLoopTime")["LoopTime"] == pytest.approx(1_391, abs=5)
    for exposure in (1, 2, 3):
        bench.send("Exposure", exposure=exposure)
    bench.send("StopLoop")
    iterations = bench.telemetry("LoopStatus")["Iterations"]
    bench.run()  # all are served although there is no idle time
    assert bench.telemetry("Exposure")["exposure"] == 3
    assert bench.telemetry("LoopStatus")["Iterations"] == iterations + 1
    assert not bench.telemetry("LoopStatus")["Running"]


def test_stopping_ends_the_resets_and_keeps_the_results(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.start_loop(1.5)
    bench.send("StopLoop")
    bench.run()
    assert len(bench.resets) == 1
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    bench.command("ProcessImage")
    assert bench.status() is TaskStatus.CALCULATED


@pytest.mark.parametrize("name", ["MCUReset", "TestWDG"])
def test_the_loop_goes_on_after_other_resets(bench: Bench, name: str) -> None:
    start_us = bench.start_loop(0.95)
    bench.send(name)
    bench.run(until_us=start_us + 8_000_000)
    assert bench.telemetry("LoopStatus")["Running"]
    assert np.diff(bench.stored_us()[-4:]) == pytest.approx(ITERATION_US, abs=100)


def test_a_reset_by_telecommand_ends_the_loop(bench: Bench) -> None:
    bench.start_loop(0.95)
    bench.send("Reset")
    bench.run()
    assert not bench.telemetry("LoopStatus")["Running"]
    assert bench.telemetry("LoopStatus")["Iterations"] == 0


# --- trigger --------------------------------------------------------------------------------------


def test_triggering_twice(bench: Bench) -> None:
    bench.start_loop(0.95)
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 40_000)
    assert bench.flags() == {"TriggerAlreadySet"}


def test_triggering_while_the_delay_timer_runs(bench: Bench) -> None:
    bench.command("setDelayTimerTimeout", Time=1.0)
    for _ in range(2):  # also after the loop ran before
        bench.command("ClearErrorFlags")
        bench.log.clear()
        start_us = bench.start_loop(0.5)
        bench.send("Trigger")
        bench.run(until_us=start_us + 950_000)
        assert bench.flags() == {"TimerAlreadyRunning"}
        assert bench.stored_us() == []
        bench.run(until_us=start_us + 1_950_000)
        assert len(bench.stored_us()) == 1
        bench.send("Trigger")
        bench.run(until_us=start_us + 1_980_000)
        assert "TriggerAlreadySet" in bench.flags()
        bench.send("StopLoop")
        bench.run()


def test_stopping_while_the_delay_timer_runs(bench: Bench) -> None:
    bench.command("setDelayTimerTimeout", Time=1.0)
    bench.start_loop(0.5)
    bench.command("StopLoop")
    assert bench.stored_us() == []
    assert bench.telemetry("LoopStatus")["Iterations"] == 0
