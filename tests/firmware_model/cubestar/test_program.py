"""The main loop: the 1 Hz pipeline, resets, trouble."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.image_memory import ITERATION_US
from cubestack.firmware_model.cubestar.image_sensor import SETTLE_US
from cubestack.firmware_model.cubestar.program import RESET_LEAD_US
from cubestack.firmware_model.interface.cubestar import ResetCause
from cubestack.firmware_model.mcu.requests import (
    AwaitPin,
    CameraTransfer,
    Pay,
    Request,
    Reset,
    SetPin,
    StrobeRead,
)

from .harness import FRAME_US, Harness
from .sky import Sky, attitude_of, error_deg, take


def test_loop_period_is_exactly_one_second(unit: Harness) -> None:
    unit.start_loop(20.5)
    times = unit.stored_us()[1:]  # the first one includes the camera's set-up
    assert len(times) == 20
    assert {later - earlier for earlier, later in pairwise(times)} == {ITERATION_US}
    assert "TimingError" not in unit.flags()


def test_host_traffic_does_not_move_the_iterations(unit: Harness) -> None:
    start_us = unit.start_loop(0.5)
    rng = np.random.default_rng(5)
    for now_us in sorted(rng.integers(600_000, 12_000_000, 400)):
        unit.run(until_us=start_us + int(now_us))
        unit.telemetry("LogStatus")
        if rng.random() < 0.2:
            unit.send("ClearErrorFlags")
    times = unit.stored_us()[1:]
    assert len(times) > 10
    assert np.diff(times) == pytest.approx(ITERATION_US, abs=1_000)
    assert len(unit.resets) == unit.telemetry("LoopStatus")["Iterations"]


def test_delays_at_iteration_start_do_not_accumulate(unit: Harness) -> None:
    start_us = unit.start_loop(0.9)
    for number in range(1, 11):
        unit.run(until_us=start_us + number * ITERATION_US)
        unit.telemetry("LogStatus")  # an interrupt at the very moment
    unit.run(until_us=start_us + 11 * ITERATION_US)
    times = unit.stored_us()
    assert times[10] - times[1] == pytest.approx(9 * ITERATION_US, abs=50)


def test_iteration_processes_while_the_next_frame_is_stored(lit: Harness) -> None:
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
        status = lit.status().name
        if status.endswith("ING") and status != "CAPTURING" and status not in order:
            order.append(status)

    lit.start_loop(0.9)
    lit.on_request = note
    lit.run(until_us=lit.now_us + 1_100_000)
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


def test_attitude_of_an_image_is_available_one_iteration_later(
    unit: Harness, catalogue: StarCatalogue, pose: Rotation
) -> None:
    poses = [pose * Rotation.from_euler("z", 0.2 * step, degrees=True) for step in range(4)]
    start_us = unit.start_loop(0.1)
    for number, true in enumerate(poses):
        unit.picture = take(catalogue, true).picture
        unit.run(until_us=start_us + ITERATION_US * (number + 1) - 50_000)
        values = unit.telemetry("AttitudeQuaternion")
        assert values["FrameCounter"] == number
        if number:
            assert values["Valid"]
            assert error_deg(attitude_of(values), poses[number - 1]) < 0.01
            stored_at = unit.stored_us()[number - 1]
            # Mid-exposure of the middle row: half the exposure before the read-out's middle.
            assert values["ImageTime"] == pytest.approx(stored_at / 1000 + 386 - 227, abs=2)


def test_loop_reset_loses_results_but_keeps_settings_and_attitude(lit: Harness, sky: Sky) -> None:
    lit.command("setIDMargin", Margin=0.0012)
    lit.command("IDStars")
    start_us = lit.start_loop(1.98)
    before = lit.telemetry("AttitudeQuaternion")
    assert before["Valid"]
    assert lit.telemetry("DetectionTimingTwo")["MaxStarDetectionTime"] > 10
    due_us = start_us + 2 * ITERATION_US
    lit.run(until_us=due_us - RESET_LEAD_US - 100)  # results can be read until then
    assert lit.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    lit.run(until_us=due_us - RESET_LEAD_US + 2_000)
    assert lit.resets == [ResetCause.SYSTEM_REQUEST] * 2
    # RAM is lost ...
    assert lit.telemetry("DetectionSummary")["NumStarsDetected"] == 0
    assert lit.telemetry("DetectionTimingTwo")["MaxStarDetectionTime"] == 0
    assert lit.telemetry("NumIdStars")["numIdStars"] == 0
    # ... settings, counters, flags, picture and attitude are not.
    assert lit.telemetry("IDMargin")["Margin"] == 0.0012
    assert lit.telemetry("ExtendedIdentification")["TcmdCount"] == 3
    assert lit.telemetry("LoopStatus")["Iterations"] == 2
    assert lit.flags() == {"StatusError"}
    assert lit.telemetry("AttitudeQuaternion") == before
    assert np.array_equal(lit.external_ram[: sky.picture.size], sky.picture.reshape(-1))


def test_loop_phases_add_up_to_the_iteration_period(unit: Harness) -> None:
    unit.start_loop(3.9)
    values = unit.telemetry("PhaseTimes")
    total = sum(values[name] for name in ("Idle", "Discard", "Capture", "Transfer"))
    assert total == pytest.approx(ITERATION_US, abs=1_000)
    assert values["Discard"] == pytest.approx(70_000, abs=10)
    assert values["Idle"] + values["LoopTotal"] == pytest.approx(ITERATION_US, abs=100)
    times = unit.telemetry("StartAndLoopTime")
    assert times["StartupTime"] == Harness.boot_us / 1000
    assert times["LoopTime"] == pytest.approx(values["LoopTotal"] / 1000, abs=0.5)
    assert times["MaxLoopTime"] > times["LoopTime"]  # the first one set the camera up


def test_loop_does_not_process_after_a_failed_capture(lit: Harness) -> None:
    start_us = lit.start_loop(1.9)
    assert lit.telemetry("AttitudeQuaternion")["FrameCounter"] == 1
    lit.camera_refuses = lambda _data: True
    lit.run(until_us=start_us + 2_900_000)
    assert lit.telemetry("AttitudeQuaternion")["FrameCounter"] == 2  # processed all the same
    written = lit.flash.writes["attitude"]
    lit.run(until_us=start_us + 5_900_000)
    assert lit.flash.writes["attitude"] == written
    lit.camera_refuses = lambda _data: False
    lit.run(until_us=start_us + 7_900_000)
    values = lit.telemetry("AttitudeQuaternion")
    assert values["Valid"]
    assert values["FrameCounter"] == 3
    assert np.diff(lit.stored_us()[-2:]) == pytest.approx(ITERATION_US, abs=10_000)


def test_latch_up_in_the_loop_costs_one_frame(lit: Harness) -> None:

    def strike(request: Request) -> None:
        if isinstance(request, AwaitPin):
            lit.on_request = lambda _request: None
            lit.program.supply.overcurrent("imager")
            lit.never_stored()

    start_us = lit.start_loop(2.95)
    lit.on_request = strike
    lit.run(until_us=start_us + 9_950_000)
    assert lit.switches["imager"]
    assert lit.telemetry("SupplyReport")["PowerCycles"] == 1
    assert "ImageCaptureError" in lit.flags()
    assert lit.telemetry("AttitudeQuaternion")["Valid"]
    assert np.diff(lit.stored_us()[-3:]) == pytest.approx(ITERATION_US, abs=10_000)


def test_a_latch_up_at_the_reset_is_not_forgotten(unit: Harness) -> None:
    start_us = unit.start_loop(0.9)
    pays = []

    def strike(request: Request) -> None:
        # While the last charged cycles are paid is when the last interrupt can come.
        if isinstance(request, Pay):
            pays.append(unit.now_us)
            unit.program.supply.overcurrent("memory")

    unit.on_request = strike
    unit.run(until_us=start_us + ITERATION_US - 5_000)
    assert len(pays) == 2
    assert not unit.switches["memory"]
    assert unit.resets == [ResetCause.SYSTEM_REQUEST]
    unit.on_request = lambda _request: None
    unit.run(until_us=start_us + 2 * ITERATION_US)
    assert unit.switches["memory"]
    assert unit.telemetry("SupplyReport")["PowerCycles"] == 1


def test_node_still_answers_during_a_persistent_short_circuit(unit: Harness) -> None:
    def shorted(_request: Request) -> None:
        if unit.switches["imager"]:
            unit.program.supply.overcurrent("imager")

    unit.on_request = shorted
    start_us = unit.start_loop(5.0)
    assert unit.telemetry("LoopStatus")["Iterations"] >= 3
    assert unit.telemetry("SupplyReport")["LatchUps"] > 5
    assert not unit.switches["imager"]
    unit.send("StopLoop")
    unit.run(until_us=start_us + 8_000_000)
    assert not unit.telemetry("LoopStatus")["Running"]
    unit.on_request = lambda _request: None
    unit.run()
    unit.command("CaptureImage")
    assert unit.telemetry("PowerStatus")["Status"] == 1


def test_startup_time_is_the_boot_time_after_every_reset(unit: Harness) -> None:
    assert unit.telemetry("StartAndLoopTime")["StartupTime"] == Harness.boot_us / 1000
    unit.command("CaptureImage", "MCUReset")
    assert unit.telemetry("StartAndLoopTime")["StartupTime"] == Harness.boot_us / 1000
    unit.command("TestWDG")
    assert unit.telemetry("StartAndLoopTime")["StartupTime"] == Harness.boot_us / 1000


# --- telemetry PhaseTimes -------------------------------------------------------------------------


def idle_us(unit: Harness) -> int:
    return int(unit.telemetry("PhaseTimes")["Idle"])


def test_idle_time_is_the_sleep_since_the_last_capture(unit: Harness) -> None:
    unit.run(until_us=unit.now_us + 123_000)
    unit.command("CaptureImage")
    assert idle_us(unit) == pytest.approx(123_000 + Harness.boot_us, abs=50)
    unit.run(until_us=unit.now_us + 50_000)
    unit.command("Exposure")  # wakes the program, and is short
    unit.run(until_us=unit.now_us + 60_000)
    assert idle_us(unit) == pytest.approx(123_000 + Harness.boot_us, abs=50)  # still that
    unit.command("CaptureImage")
    assert idle_us(unit) == pytest.approx(110_000, abs=200)


def test_work_time_is_not_counted_as_idle(unit: Harness) -> None:
    unit.command("CaptureImage", "TestSRAM", "CaptureImage")
    assert idle_us(unit) < 100


def test_reset_counts_as_idle_time(unit: Harness) -> None:
    unit.command("CaptureImage")
    unit.run(until_us=unit.now_us + 10_000)
    unit.command("MCUReset")
    unit.run(until_us=unit.now_us + 20_000)
    unit.command("CaptureImage")
    assert idle_us(unit) == pytest.approx(30_000 + Harness.boot_us, abs=200)


def test_phase_times_of_the_last_capture_survive_a_reset(unit: Harness) -> None:
    unit.command("CaptureImage")
    before = unit.telemetry("PhaseTimes")
    assert before["Capture"] == pytest.approx(FRAME_US, abs=10)
    unit.command("MCUReset")
    assert unit.telemetry("PhaseTimes") == before


def test_reset_waits_for_the_camera_to_settle_if_it_was_never_set_up(unit: Harness) -> None:
    """It may have got its supply only now; one that was set up has long settled."""
    times_us = []
    for commands in (("MCUReset",), ("CaptureImage", "MCUReset")):
        unit.command(*commands[:-1])
        start_us = unit.now_us
        unit.command(commands[-1])
        times_us.append(unit.now_us - start_us)
    assert times_us[0] - times_us[1] == pytest.approx(SETTLE_US, abs=100)
