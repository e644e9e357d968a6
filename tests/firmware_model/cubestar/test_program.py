"""The main loop: the 1 Hz pipeline, resets, trouble."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.program import ITERATION_US, RESET_LEAD_US
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

from .bench import BOOT_US, Bench
from .sky import Sky, attitude_of, error_deg, take

# --- one iteration after the other ----------------------------------------------------------------


def test_the_period_is_exactly_one_second(bench: Bench) -> None:
    bench.start_loop(20.5)
    times = bench.stored_us()[1:]  # the first one includes the camera's set-up
    assert len(times) == 20
    assert {later - earlier for earlier, later in pairwise(times)} == {ITERATION_US}
    assert "TimingError" not in bench.flags()


def test_host_traffic_does_not_move_the_iterations(bench: Bench) -> None:
    start_us = bench.start_loop(0.5)
    rng = np.random.default_rng(5)
    for now_us in sorted(rng.integers(600_000, 12_000_000, 400)):
        bench.run(until_us=start_us + int(now_us))
        bench.telemetry("LogStatus")
        if rng.random() < 0.2:
            bench.send("ClearErrorFlags")
    times = bench.stored_us()[1:]
    assert len(times) > 10
    assert np.diff(times) == pytest.approx(ITERATION_US, abs=1_000)
    assert len(bench.resets) == bench.telemetry("LoopStatus")["Iterations"]


def test_delays_at_the_start_do_not_add_up(bench: Bench) -> None:
    start_us = bench.start_loop(0.9)
    for number in range(1, 11):
        bench.run(until_us=start_us + number * ITERATION_US)
        bench.telemetry("LogStatus")  # an interrupt at the very moment
    bench.run(until_us=start_us + 11 * ITERATION_US)
    times = bench.stored_us()
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
        status = bench.status().name
        if status.endswith("ING") and status != "CAPTURING" and status not in order:
            order.append(status)

    bench.start_loop(0.9)
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
    start_us = bench.start_loop(0.1)
    for number, true in enumerate(poses):
        bench.picture = take(catalogue, true).picture
        bench.run(until_us=start_us + ITERATION_US * (number + 1) - 50_000)
        values = bench.telemetry("AttitudeQuaternion")
        assert values["FrameCounter"] == number
        if number:
            assert values["Valid"]
            assert error_deg(attitude_of(values), poses[number - 1]) < 0.01
            stored_at = bench.stored_us()[number - 1]
            # Mid-exposure of the middle row: half the exposure before the read-out's middle.
            assert values["ImageTime"] == pytest.approx(stored_at / 1000 + 386 - 227, abs=2)


def test_what_survives_the_reset(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("setIDMargin", Margin=0.0012)
    bench.command("IDStars")
    start_us = bench.start_loop(1.98)
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
    start_us = bench.start_loop(1.98)
    due_us = start_us + 2 * ITERATION_US
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    bench.run(until_us=due_us - RESET_LEAD_US - 100)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == len(sky.stars)
    bench.run(until_us=due_us - RESET_LEAD_US + 2_000)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0


def test_the_phases_fill_the_second(bench: Bench) -> None:
    bench.start_loop(3.9)
    values = bench.telemetry("PhaseTimes")
    total = sum(values[name] for name in ("Idle", "Discard", "Capture", "Transfer"))
    assert total == pytest.approx(ITERATION_US, abs=1_000)
    assert values["Discard"] == pytest.approx(70_000, abs=10)
    assert values["Idle"] + values["LoopTotal"] == pytest.approx(ITERATION_US, abs=100)
    times = bench.telemetry("StartAndLoopTime")
    assert times["StartupTime"] == BOOT_US / 1000
    assert times["LoopTime"] == pytest.approx(values["LoopTotal"] / 1000, abs=0.5)
    assert times["MaxLoopTime"] > times["LoopTime"]  # the first one set the camera up


# --- trouble --------------------------------------------------------------------------------------


def test_a_failed_capture_leaves_nothing_to_process(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    start_us = bench.start_loop(1.9)
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
    assert np.diff(bench.stored_us()[-2:]) == pytest.approx(ITERATION_US, abs=10_000)


def test_a_latch_up_in_the_loop_costs_one_picture(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture

    def strike(request: Request) -> None:
        if isinstance(request, AwaitPin):
            bench.on_request = lambda _request: None
            bench.program.supply.overcurrent("imager")
            bench.never_stored()

    start_us = bench.start_loop(2.95)
    bench.on_request = strike
    bench.run(until_us=start_us + 9_950_000)
    assert bench.switches["imager"]
    assert bench.telemetry("SupplyReport")["PowerCycles"] == 1
    assert "ImageCaptureError" in bench.flags()
    assert bench.telemetry("AttitudeQuaternion")["Valid"]
    assert np.diff(bench.stored_us()[-3:]) == pytest.approx(ITERATION_US, abs=10_000)


def test_a_latch_up_at_the_reset_is_not_forgotten(bench: Bench) -> None:
    start_us = bench.start_loop(0.9)
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
    start_us = bench.start_loop(5.0)
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
