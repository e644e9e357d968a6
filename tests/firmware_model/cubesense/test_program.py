"""The main loop: start, jobs in their order, resets, and the watch over the memories."""

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.program import DRAIN_US
from cubestack.firmware_model.cubesense.supply import SAMPLE_US
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    Camera,
    CaptureResult,
    DetectResult,
    ResetTarget,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.pins import CAMERA_POWER, SRAM_POWER
from cubestack.firmware_model.mcu.requests import Request, Reset, SetPin, Sleep

from .bench import BOOT_US, LOST, Bench
from .scenery import earth


def test_memories_come_on_before_cameras_and_both_are_ready_soon(bench: Bench) -> None:
    switched = [r.pin for _, r in bench.log if isinstance(r, SetPin) and "POWER" in r.pin]
    assert switched == [*SRAM_POWER.values(), *CAMERA_POWER.values()]
    assert bench.now_us - BOOT_US < 10_000
    assert bench.program.idle


def test_nothing_runs_by_itself(bench: Bench) -> None:
    bench.log.clear()
    bench.run(until_us=bench.now_us + 1_000_000)
    requests = [request for _, request in bench.log]
    assert all(isinstance(request, Sleep) for request in requests)
    assert 1_000_000 / SAMPLE_US * 0.9 < bench.meter.counts["adc_conversion"] / 2 < 220


def test_jobs_are_done_in_their_order(bench: Bench) -> None:
    bench.scenes[Camera.NADIR] = earth(5, 5)
    for camera, sram in ((0, 1), (1, 0), (1, 1), (0, 0)):
        assert bench.send("CaptureAndDetect", Camera=camera, Sram=sram) == 0
    bench.log.clear()
    bench.run()
    levels = {"SHIFT": 0, "EDGE": 0, "RNW": 0}
    stores = []
    for request in (r for _, r in bench.log if isinstance(r, SetPin)):
        if request.pin in levels:
            levels[request.pin] = request.level
        elif request in (SetPin("SUNEN", 0), SetPin("NADEN", 0)) and not levels["EDGE"]:
            stores.append((levels["SHIFT"], levels["RNW"], request.pin))
    linked_from_sun = [(1, 0, "SUNEN"), (1, 0, "NADEN")]
    linked_from_nadir = [(1, 1, "SUNEN"), (1, 1, "NADEN")]
    assert stores == [*linked_from_sun, *linked_from_nadir, (0, 0, "NADEN"), (0, 0, "SUNEN")]


def test_a_program_reset_starts_anew(bench: Bench) -> None:
    bench.scenes[Camera.NADIR] = earth(5, 5)
    bench.command("DetectionThreshold2", Threshold=99)
    bench.command("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM2)
    bench.latched.add(Sram.SRAM1)
    bench.run(until_us=bench.now_us + 2 * SAMPLE_US)
    assert bench.cut() == {Sram.SRAM1}
    bench.command("Reset", Target=ResetTarget.MCU)
    assert bench.resets == [1]
    assert bench.telemetry("Result2") == {
        "Alpha": 0,
        "Beta": 0,
        "Capture": CaptureResult.START_UP,
        "Detect": DetectResult.START_UP,
    }
    assert bench.telemetry("Configuration")["Threshold2"] == 70
    assert bench.cut() == set()
    assert (bench.memories[Sram.SRAM2] == LOST).all()  # its switch opened
    assert bench.program.cameras.acknowledged(Camera.NADIR)


@pytest.mark.parametrize("stuck", [False, True])
def test_a_reset_lets_the_acknowledge_out_but_not_for_ever(bench: Bench, stuck: bool) -> None:
    reset_us: list[int] = []
    start_us = bench.now_us
    bench.backlog[Port.NODE] = 5

    def send(request: Request) -> None:
        if not stuck and bench.now_us > start_us + 4_000:
            bench.backlog[Port.NODE] = 0
        if isinstance(request, Reset):
            reset_us.append(bench.now_us - start_us)

    bench.on_request = send
    message = INTERFACE.telecommand("Reset")
    bench.i2c_write(bytes([message.id]) + message.pack(Target=ResetTarget.MCU))
    bench.run()
    (waited_us,) = reset_us
    assert waited_us == pytest.approx(DRAIN_US if stuck else 4_500, abs=2_000)


def test_two_lives_are_alike(bench: Bench) -> None:
    bench.scenes[Camera.NADIR] = earth(-8, 3)
    results = []
    for _ in range(2):
        bench.command("Reset", Target=ResetTarget.MCU)
        bench.command("CaptureAndDetect", Camera=Camera.NADIR, Sram=Sram.SRAM1)
        results.append((bench.telemetry("Result2"), bench.telemetry("Details2")))
    assert results[0] == results[1]
    assert np.array_equal(bench.memories[Sram.SRAM1], bench.scenes[Camera.NADIR])
