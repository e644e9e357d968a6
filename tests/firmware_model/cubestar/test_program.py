"""The main loop: commands, the 1 Hz pipeline, resets."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.program import ITERATION_US, RESET_LEAD_US
from cubestack.firmware_model.hardware import (
    AwaitPin,
    CameraTransfer,
    Pay,
    Request,
    Reset,
    SetPin,
    StrobeRead,
)
from cubestack.firmware_model.interface.cubestar import INTERFACE, ResetCause, TaskStatus
from cubestack.firmware_model.interface.frames import encode_frame
from cubestack.firmware_model.star_catalogue import StarCatalogue

from .bench import BOOT_US, Bench
from .sky import Sky, attitude_of, error_deg, take

STORE = SetPin("ENABLE", 1)


def stored_us(bench: Bench) -> list[int]:
    """When the FPGA was enabled to store a picture."""
    times, rnw = [], 0
    for now_us, request in bench.log:
        if isinstance(request, SetPin) and request.pin == "RNW":
            rnw = request.level
        if request == STORE and not rnw:
            times.append(now_us)
    return times


def start(bench: Bench, seconds: float) -> int:
    """Trigger the loop and run it; returns when it was triggered."""
    start_us = bench.now_us
    bench.send("Trigger")
    bench.run(until_us=start_us + round(seconds * 1e6))
    return start_us


# --- one iteration after the other ----------------------------------------------------------------


def test_the_period_is_exactly_one_second(bench: Bench) -> None:
    start(bench, 20.5)
    times = stored_us(bench)[1:]  # the first one includes the camera's set-up
    assert len(times) == 20
    assert {later - earlier for earlier, later in pairwise(times)} == {ITERATION_US}
    assert "TimingError" not in bench.flags()


def test_host_traffic_does_not_move_the_iterations(bench: Bench) -> None:
    start_us = start(bench, 0.5)
    rng = np.random.default_rng(5)
    for now_us in sorted(rng.integers(600_000, 12_000_000, 400)):
        bench.run(until_us=start_us + int(now_us))
        bench.telemetry("LogStatus")
        if rng.random() < 0.2:
            bench.send("ClearErrorFlags")
    times = stored_us(bench)[1:]
    assert len(times) > 10
    assert np.diff(times) == pytest.approx(ITERATION_US, abs=1_000)
    assert len(bench.resets) == bench.telemetry("LoopStatus")["Iterations"]


def test_delays_at_the_start_do_not_add_up(bench: Bench) -> None:
    start_us = start(bench, 0.9)
    for number in range(1, 11):
        bench.run(until_us=start_us + number * ITERATION_US)
        bench.telemetry("LogStatus")  # an interrupt at the very moment
    bench.run(until_us=start_us + 11 * ITERATION_US)
    times = stored_us(bench)
    assert times[10] - times[1] == pytest.approx(9 * ITERATION_US, abs=50)


def test_an_iteration_processes_the_previous_picture_while_the_next_is_stored(
    bench: Bench, sky: Sky
) -> None:
    bench.picture = sky.picture
    order: list[str] = []

    def note(request: Request) -> None:
        names = {
            SetPin("ENABLE", 1): "enable",
            SetPin("ENABLE", 0): "disable",
            SetPin("RNW", 1): "read",
            SetPin("RNW", 0): "write",
        }
        if isinstance(request, SetPin):
            order.append(names.get(request, request.pin))
        elif isinstance(request, AwaitPin | StrobeRead | Reset | CameraTransfer):
            order.append(type(request).__name__)
        status = TaskStatus(bench.telemetry("TaskStatus")["taskStatus"]).name
        if status.endswith("ING") and status != "CAPTURING" and status not in order:
            order.append(status)

    start(bench, 0.9)
    bench.on_request = note
    bench.run(until_us=bench.now_us + 1_100_000)
    begin, end = order.index("CameraTransfer"), order.index("Reset", order.index("CameraTransfer"))
    assert order[begin : end + 1] == [
        "CameraTransfer",  # enable the sensor
        "BANK",
        "write",
        "enable",
        "DETECTING",
        "IDENTIFYING",
        "CALCULATING",
        "AwaitPin",
        "disable",
        "CameraTransfer",  # disable the sensor
        "read",
        "enable",
        "StrobeRead",
        "disable",
        "write",
        "Reset",
    ]


def test_the_attitude_of_a_picture_comes_one_iteration_later(
    bench: Bench, catalogue: StarCatalogue, pose: Rotation
) -> None:
    poses = [pose * Rotation.from_euler("z", 3 * step, degrees=True) for step in range(4)]
    start_us = start(bench, 0.1)
    for number, true in enumerate(poses):
        bench.picture = take(catalogue, true).picture
        bench.run(until_us=start_us + ITERATION_US * (number + 1) - 50_000)
        values = bench.telemetry("AttitudeQuaternion")
        assert values["FrameCounter"] == number
        if number:
            assert values["Valid"]
            assert error_deg(attitude_of(values), poses[number - 1]) < 0.01
            stored_at = stored_us(bench)[number - 1]
            # Mid-exposure of the middle row: half the exposure before the read-out's middle.
            assert values["ImageTime"] == pytest.approx(stored_at / 1000 + 386 - 227, abs=2)


def test_what_survives_the_reset(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("setIDMargin", Margin=0.0012)
    bench.command("IDStars")
    start_us = start(bench, 1.98)
    before = bench.telemetry("AttitudeQuaternion")
    assert before["Valid"]
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    assert bench.telemetry("DetectionTimingTwo")["MaxStarDetectionTime"] > 10
    bench.run(until_us=start_us + 2_005_000)
    assert bench.resets == [ResetCause.SYSTEM_REQUEST] * 2
    # RAM is lost ...
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0
    assert bench.telemetry("DetectionTimingTwo")["MaxStarDetectionTime"] == 0
    assert bench.telemetry("NumIdStars")["numIdStars"] == 0
    # ... settings, counters, flags, picture and attitude are not.
    assert bench.telemetry("IDMargin")["Margin"] == 0.0012
    assert bench.telemetry("ExtendedIdentification")["TcmdCount"] == 3
    assert bench.telemetry("LoopStatus")["Iterations"] == 2
    assert bench.flags() == {"StatusError"}
    assert bench.telemetry("AttitudeQuaternion") == before
    assert np.array_equal(bench.external_ram[: sky.picture.size], sky.picture.reshape(-1))


def test_results_can_be_read_until_shortly_before_the_next_iteration(
    bench: Bench, sky: Sky
) -> None:
    bench.picture = sky.picture
    start_us = start(bench, 1.98)
    due_us = start_us + 2 * ITERATION_US
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    bench.run(until_us=due_us - RESET_LEAD_US - 100)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    bench.run(until_us=due_us - RESET_LEAD_US + 2_000)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0


def test_the_phases_fill_the_second(bench: Bench) -> None:
    start(bench, 3.9)
    values = bench.telemetry("PhaseTimes")
    total = sum(values[name] for name in ("Idle", "Discard", "Capture", "Transfer"))
    assert total == pytest.approx(ITERATION_US, abs=1_000)
    assert values["Discard"] == pytest.approx(70_000, abs=10)
    assert values["Idle"] + values["LoopTotal"] == pytest.approx(ITERATION_US, abs=100)
    times = bench.telemetry("StartAndLoopTime")
    assert times["StartupTime"] == BOOT_US / 1000
    assert times["LoopTime"] == pytest.approx(values["LoopTotal"] / 1000, abs=0.5)
    assert times["MaxLoopTime"] > times["LoopTime"]  # the first one set the camera up


# --- telecommands meanwhile -----------------------------------------------------------------------


def test_telecommands_are_served_in_the_idle_time(bench: Bench) -> None:
    start_us = start(bench, 1.5)  # in the middle of a capture
    bench.send("Exposure", exposure=77)
    assert bench.telemetry("TcmdProcessed")["Processed"] == 0
    bench.run(until_us=start_us + 1_980_000)
    assert bench.telemetry("TcmdProcessed")["Processed"] == 1
    assert bench.telemetry("Exposure")["exposure"] == 77
    bench.run(until_us=start_us + 2_900_000)
    assert bench.camera_value("EXPOSURE") == 77
    assert "TimingError" not in bench.flags()


def test_a_telecommand_that_comes_just_before_the_reset_is_not_lost(bench: Bench) -> None:
    start_us = start(bench, 0.5)
    for number, early_us in enumerate((200, 20, 2, 1), start=1):
        bench.run(until_us=start_us + number * ITERATION_US - RESET_LEAD_US - early_us)
        assert bench.send("Exposure", exposure=number) == 0
        bench.run(until_us=start_us + number * ITERATION_US + 300_000)
        assert bench.telemetry("Exposure")["exposure"] == number
    assert len(bench.resets) == 4


def test_a_frame_that_straddles_the_reset_is_not_lost(bench: Bench) -> None:
    start_us = start(bench, 0.5)
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
    assert np.diff(stored_us(bench)[1:]) == pytest.approx(ITERATION_US, abs=100)


def test_an_i2c_transfer_across_the_reset_keeps_its_answer(bench: Bench) -> None:
    start_us = start(bench, 0.5)
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
    start_us = start(bench, 0.9)
    bench.send("CaptureAndProcess")
    bench.run(until_us=start_us + 1_500_000)
    assert bench.telemetry("LoopStatus")["Iterations"] == 1
    bench.run(until_us=start_us + 6_500_000)
    assert bench.flags() == {"TimingError", "LessThanThreeStarsDetected"}
    times = stored_us(bench)
    assert times[2] - times[0] > ITERATION_US + 500_000
    assert np.diff(times[2:]) == pytest.approx(ITERATION_US, abs=100)  # in step again


def test_an_iteration_that_takes_too_long(bench: Bench) -> None:
    bench.command("SetDiscardDelay", Delay=600)  # 600 + 386 + 404 ms
    start_us = start(bench, 1.0)
    assert "TimingError" not in bench.flags()
    bench.run(until_us=start_us + 8_000_000)
    assert "TimingError" in bench.flags()
    assert np.diff(stored_us(bench)[1:]) == pytest.approx(1_390_000 + BOOT_US, abs=10_000)
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
    start(bench, 1.5)
    bench.send("StopLoop")
    bench.run()
    assert len(bench.resets) == 1
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    bench.command("ProcessImage")
    assert TaskStatus(bench.telemetry("TaskStatus")["taskStatus"]) is TaskStatus.CALCULATED


@pytest.mark.parametrize("name", ["MCUReset", "TestWDG"])
def test_the_loop_goes_on_after_other_resets(bench: Bench, name: str) -> None:
    start_us = start(bench, 0.95)
    bench.send(name)
    bench.run(until_us=start_us + 8_000_000)
    assert bench.telemetry("LoopStatus")["Running"]
    assert np.diff(stored_us(bench)[-4:]) == pytest.approx(ITERATION_US, abs=100)


def test_a_reset_by_telecommand_ends_the_loop(bench: Bench) -> None:
    start(bench, 0.95)
    bench.send("Reset")
    bench.run()
    assert not bench.telemetry("LoopStatus")["Running"]
    assert bench.telemetry("LoopStatus")["Iterations"] == 0


# --- trigger --------------------------------------------------------------------------------------


def test_triggering_twice(bench: Bench) -> None:
    start(bench, 0.95)
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 40_000)
    assert bench.flags() == {"TriggerAlreadySet"}


def test_triggering_while_the_delay_timer_runs(bench: Bench) -> None:
    bench.command("setDelayTimerTimeout", Time=1.0)
    for _ in range(2):  # also after the loop ran before
        bench.command("ClearErrorFlags")
        bench.log.clear()
        start_us = start(bench, 0.5)
        bench.send("Trigger")
        bench.run(until_us=start_us + 950_000)
        assert bench.flags() == {"TimerAlreadyRunning"}
        assert stored_us(bench) == []
        bench.run(until_us=start_us + 1_950_000)
        assert len(stored_us(bench)) == 1
        bench.send("Trigger")
        bench.run(until_us=start_us + 1_980_000)
        assert "TriggerAlreadySet" in bench.flags()
        bench.send("StopLoop")
        bench.run()


def test_stopping_while_the_delay_timer_runs(bench: Bench) -> None:
    bench.command("setDelayTimerTimeout", Time=1.0)
    start(bench, 0.5)
    bench.command("StopLoop")
    assert stored_us(bench) == []
    assert bench.telemetry("LoopStatus")["Iterations"] == 0


# --- trouble --------------------------------------------------------------------------------------


def test_a_failed_capture_leaves_nothing_to_process(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    start_us = start(bench, 1.9)
    assert bench.telemetry("AttitudeQuaternion")["FrameCounter"] == 1
    bench.camera_refuses = lambda _data: True
    bench.run(until_us=start_us + 2_900_000)
    assert bench.telemetry("AttitudeQuaternion")["FrameCounter"] == 2  # processed all the same
    written = bench.flash.writes["attitude"]
    bench.run(until_us=start_us + 5_900_000)
    assert bench.flash.writes["attitude"] == written
    bench.camera_refuses = lambda _data: False
    bench.run(until_us=start_us + 7_900_000)
    values = bench.telemetry("AttitudeQuaternion")
    assert values["Valid"]
    assert values["FrameCounter"] == 3
    assert np.diff(stored_us(bench)[-2:]) == pytest.approx(ITERATION_US, abs=10_000)


def test_a_latch_up_in_the_loop_costs_one_picture(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture

    def strike(request: Request) -> None:
        if isinstance(request, AwaitPin):
            bench.on_request = lambda _request: None
            bench.program.supply.overcurrent("imager")
            bench.never_stored()

    start_us = start(bench, 2.95)
    bench.on_request = strike
    bench.run(until_us=start_us + 9_950_000)
    assert bench.switches["imager"]
    assert bench.telemetry("SupplyReport")["PowerCycles"] == 1
    assert "ImageCaptureError" in bench.flags()
    assert bench.telemetry("AttitudeQuaternion")["Valid"]
    assert np.diff(stored_us(bench)[-3:]) == pytest.approx(ITERATION_US, abs=10_000)


def test_a_latch_up_at_the_reset_is_not_forgotten(bench: Bench) -> None:
    start_us = start(bench, 0.9)
    pays = []

    def strike(request: Request) -> None:
        # While the last charged cycles are paid is when the last interrupt can come.
        if isinstance(request, Pay):
            pays.append(bench.now_us)
            bench.program.supply.overcurrent("memory")

    bench.on_request = strike
    bench.run(until_us=start_us + ITERATION_US - 5_000)
    assert len(pays) == 2
    assert not bench.switches["memory"]
    assert bench.resets == [ResetCause.SYSTEM_REQUEST]
    bench.on_request = lambda _request: None
    bench.run(until_us=start_us + 2 * ITERATION_US)
    assert bench.switches["memory"]
    assert bench.telemetry("SupplyReport")["PowerCycles"] == 1


def test_a_lasting_short_circuit_leaves_the_node_in_command(bench: Bench) -> None:
    def shorted(_request: Request) -> None:
        if bench.switches["imager"]:
            bench.program.supply.overcurrent("imager")

    bench.on_request = shorted
    start_us = start(bench, 5.0)
    assert bench.telemetry("LoopStatus")["Iterations"] >= 3
    assert bench.telemetry("SupplyReport")["LatchUps"] > 5
    assert not bench.switches["imager"]
    bench.send("StopLoop")
    bench.run(until_us=start_us + 8_000_000)
    assert not bench.telemetry("LoopStatus")["Running"]
    bench.on_request = lambda _request: None
    bench.run()
    bench.command("CaptureImage")
    assert bench.telemetry("PowerStatus")["Status"] == 1


def test_the_time_from_reset_to_the_main_loop(bench: Bench) -> None:
    assert bench.telemetry("StartAndLoopTime")["StartupTime"] == BOOT_US / 1000
    bench.command("CaptureImage")
    bench.command("MCUReset")
    assert bench.telemetry("StartAndLoopTime")["StartupTime"] == BOOT_US / 1000
    bench.command("TestWDG")
    assert bench.telemetry("StartAndLoopTime")["StartupTime"] == BOOT_US / 1000
