"""Telecommands while the 1 Hz loop runs."""

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.image_memory import ITERATION_US
from cubestack.firmware_model.cubestar.program import RESET_LEAD_US
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE, TaskStatus

from .harness import Harness
from .sky import Sky


def test_telecommands_are_served_in_the_idle_time(unit: Harness) -> None:
    start_us = unit.start_loop(1.5)  # in the middle of a capture
    unit.send("Exposure", exposure=77)
    assert unit.telemetry("TcmdProcessed")["Processed"] == 0
    unit.run(until_us=start_us + 1_980_000)
    assert unit.telemetry("TcmdProcessed")["Processed"] == 1
    assert unit.telemetry("Exposure")["exposure"] == 77
    unit.run(until_us=start_us + 2_900_000)
    assert unit.camera_value("EXPOSURE") == 77
    assert "TimingError" not in unit.flags()


def test_telecommand_just_before_the_loop_reset_is_not_lost(unit: Harness) -> None:
    start_us = unit.start_loop(0.5)
    for number, early_us in enumerate((200, 20, 2, 1), start=1):
        unit.run(until_us=start_us + number * ITERATION_US - RESET_LEAD_US - early_us)
        assert unit.send("Exposure", exposure=number) == 0
        unit.run(until_us=start_us + number * ITERATION_US + 300_000)
        assert unit.telemetry("Exposure")["exposure"] == number
    assert len(unit.resets) == 4


def test_uart_frame_that_straddles_the_loop_reset_delays_the_reset(unit: Harness) -> None:
    start_us = unit.start_loop(0.5)
    message = INTERFACE.telecommand("Exposure")
    frame = encode_frame(bytes([message.id]) + message.pack(exposure=6))
    unit.run(until_us=start_us + ITERATION_US - RESET_LEAD_US - 50)
    assert unit.uart(frame[:4]) == []
    unit.run(until_us=start_us + ITERATION_US - 100)
    assert unit.resets == []
    assert unit.uart(frame[4:]) == [b"\0"]
    unit.run(until_us=start_us + 2 * ITERATION_US)
    assert unit.telemetry("Exposure")["exposure"] == 6
    assert len(unit.resets) == 1  # the next iteration resets again
    assert np.diff(unit.stored_us()[1:]) == pytest.approx(ITERATION_US, abs=100)


def test_i2c_transfer_across_the_reset_keeps_its_answer(unit: Harness) -> None:
    start_us = unit.start_loop(0.5)
    link = unit.program.link
    unit.run(until_us=start_us + ITERATION_US - RESET_LEAD_US - 50)
    link.i2c_start(False)
    link.i2c_write(156)
    unit.run(until_us=start_us + ITERATION_US + 100_000)
    assert unit.program.link is link
    link.i2c_start(True)
    assert link.i2c_read() == 10
    link.i2c_stop()


def test_long_telecommand_delays_the_next_iteration(unit: Harness) -> None:
    start_us = unit.start_loop(0.9)
    unit.send("CaptureAndProcess")
    unit.run(until_us=start_us + 1_500_000)
    assert unit.telemetry("LoopStatus")["Iterations"] == 1
    unit.run(until_us=start_us + 6_500_000)
    assert unit.flags() == {"TimingError", "LessThanThreeStarsDetected"}
    times = unit.stored_us()
    assert times[2] - times[0] > ITERATION_US + 500_000
    assert np.diff(times[2:]) == pytest.approx(ITERATION_US, abs=100)  # in step again


def test_iteration_longer_than_its_period_sets_timing_error(unit: Harness) -> None:
    unit.command("SetDiscardDelay", Delay=600)  # 600 + 386 + 404 ms
    start_us = unit.start_loop(1.0)
    assert "TimingError" not in unit.flags()
    unit.run(until_us=start_us + 8_000_000)
    assert "TimingError" in unit.flags()
    assert np.diff(unit.stored_us()[1:]) == pytest.approx(1_390_000 + Harness.boot_us, abs=10_000)
    assert unit.telemetry("StartAndLoopTime")["LoopTime"] == pytest.approx(1_391, abs=5)
    for exposure in (1, 2, 3):
        unit.send("Exposure", exposure=exposure)
    unit.send("StopLoop")
    iterations = unit.telemetry("LoopStatus")["Iterations"]
    unit.run()  # all are served although there is no idle time
    assert unit.telemetry("Exposure")["exposure"] == 3
    assert unit.telemetry("LoopStatus")["Iterations"] == iterations + 1
    assert not unit.telemetry("LoopStatus")["Running"]


def test_stop_loop_ends_the_resets_and_keeps_the_results(lit: Harness, sky: Sky) -> None:
    lit.start_loop(1.5)
    lit.command("StopLoop")
    assert len(lit.resets) == 1
    assert lit.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    lit.command("ProcessImage")
    assert lit.status() is TaskStatus.CALCULATED


@pytest.mark.parametrize("name", ["MCUReset", "TestWDG"])
def test_loop_continues_after_other_resets(unit: Harness, name: str) -> None:
    start_us = unit.start_loop(0.95)
    unit.send(name)
    unit.run(until_us=start_us + 8_000_000)
    assert unit.telemetry("LoopStatus")["Running"]
    assert np.diff(unit.stored_us()[-4:]) == pytest.approx(ITERATION_US, abs=100)


def test_telecommanded_reset_ends_the_loop(unit: Harness) -> None:
    unit.start_loop(0.95)
    unit.command("Reset")
    assert not unit.telemetry("LoopStatus")["Running"]
    assert unit.telemetry("LoopStatus")["Iterations"] == 0


def test_second_trigger_during_the_delay_sets_timer_already_running(unit: Harness) -> None:
    unit.command("setDelayTimerTimeout", Time=100)
    for _ in range(2):  # also after the loop ran before
        unit.command("ClearErrorFlags")
        unit.log.clear()
        start_us = unit.start_loop(0.5)
        unit.send("Trigger")
        unit.run(until_us=start_us + 950_000)
        assert unit.flags() == {"TimerAlreadyRunning"}
        assert unit.stored_us() == []
        unit.run(until_us=start_us + 1_950_000)
        assert len(unit.stored_us()) == 1
        unit.send("Trigger")
        unit.run(until_us=start_us + 1_980_000)
        assert "TriggerAlreadySet" in unit.flags()
        unit.command("StopLoop")


def test_stop_loop_during_the_delay_prevents_the_first_iteration(unit: Harness) -> None:
    unit.command("setDelayTimerTimeout", Time=100)
    unit.start_loop(0.5)
    unit.command("StopLoop")
    assert unit.stored_us() == []
    assert unit.telemetry("LoopStatus")["Iterations"] == 0
