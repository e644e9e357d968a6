"""The main loop: start, jobs in their order, resets, and the watch over the memories."""

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.program import DRAIN_US
from cubestack.firmware_model.cubesense.supply import SAMPLE_US
from cubestack.firmware_model.interface.cubesense import codes, pins
from cubestack.firmware_model.mcu.requests import Request, Reset, SetPin, Sleep

from .harness import LOST, Harness
from .scenery import earth


def test_memories_come_on_before_cameras_and_both_are_ready_soon(unit: Harness) -> None:
    switched = [r.pin for _, r in unit.log if isinstance(r, SetPin) and "POWER" in r.pin]
    assert switched == [*pins.SRAM_POWER.values(), *pins.CAMERA_POWER.values()]
    assert unit.now_us - Harness.boot_us < 10_000
    assert unit.program.idle


def test_nothing_starts_without_a_command(unit: Harness) -> None:
    unit.log.clear()
    unit.run(until_us=unit.now_us + 1_000_000)
    requests = [request for _, request in unit.log]
    assert all(isinstance(request, Sleep) for request in requests)
    assert 1_000_000 / SAMPLE_US * 0.9 < unit.meter.counts["adc_conversion"] / 2 < 220


def test_jobs_are_done_in_their_order(unit: Harness) -> None:
    unit.scenes[codes.Camera.NADIR] = earth(5, 5)
    for camera, sram in ((0, 1), (1, 0), (1, 1), (0, 0)):
        assert unit.send("CaptureAndDetect", Camera=camera, Sram=sram) == 0
    unit.log.clear()
    unit.run()
    levels, stores = {"SHIFT": 0, "EDGE": 0, "RNW": 0}, []
    for request in (r for _, r in unit.log if isinstance(r, SetPin)):
        if request.pin in levels:
            levels[request.pin] = request.level
        elif request in (SetPin("SUNEN", 0), SetPin("NADEN", 0)) and not levels["EDGE"]:
            stores.append((levels["SHIFT"], levels["RNW"], request.pin))
    linked_from_sun = [(1, 0, "SUNEN"), (1, 0, "NADEN")]
    linked_from_nadir = [(1, 1, "SUNEN"), (1, 1, "NADEN")]
    assert stores == [*linked_from_sun, *linked_from_nadir, (0, 0, "NADEN"), (0, 0, "SUNEN")]


def test_a_program_reset_starts_anew(unit: Harness) -> None:
    unit.scenes[codes.Camera.NADIR] = earth(5, 5)
    unit.command("DetectionThreshold2", Threshold=99)
    unit.command("CaptureAndDetect", Camera=codes.Camera.NADIR, Sram=codes.Sram.SRAM2)
    unit.latched.add(codes.Sram.SRAM1)
    unit.run(until_us=unit.now_us + 2 * SAMPLE_US)
    assert unit.cut() == {codes.Sram.SRAM1}
    unit.command("Reset", Target=codes.ResetTarget.MCU)
    assert unit.resets == [1]
    assert unit.telemetry("Result2") == {
        "Alpha": 0,
        "Beta": 0,
        "Capture": codes.CaptureResult.START_UP,
        "Detect": codes.DetectResult.START_UP,
    }
    assert unit.telemetry("Configuration")["Threshold2"] == 70
    assert unit.cut() == set()
    assert (unit.memories[codes.Sram.SRAM2] == LOST).all()  # its switch opened
    assert unit.program.cameras.acknowledged(codes.Camera.NADIR)


@pytest.mark.parametrize("stuck", [False, True])
def test_a_reset_lets_the_acknowledge_out_but_not_for_ever(unit: Harness, stuck: bool) -> None:
    reset_us: list[int] = []
    start_us = unit.now_us
    unit.backlog = 5

    def send(request: Request) -> None:
        if not stuck and unit.now_us > start_us + 4_000:
            unit.backlog = 0
        if isinstance(request, Reset):
            reset_us.append(unit.now_us - start_us)

    unit.on_request = send
    unit.i2c_write(bytes([0, codes.ResetTarget.MCU]))
    unit.run()
    (waited_us,) = reset_us
    assert waited_us == pytest.approx(DRAIN_US if stuck else 4_500, abs=2_000)


def test_two_runs_are_identical(unit: Harness) -> None:
    unit.scenes[codes.Camera.NADIR] = earth(-8, 3)
    results = []
    for _ in range(2):
        unit.command("Reset", Target=codes.ResetTarget.MCU)
        unit.command("CaptureAndDetect", Camera=codes.Camera.NADIR, Sram=codes.Sram.SRAM1)
        results.append((unit.telemetry("Result2"), unit.telemetry("Details2")))
    assert results[0] == results[1]
    assert np.array_equal(unit.memories[codes.Sram.SRAM1], unit.scenes[codes.Camera.NADIR])
