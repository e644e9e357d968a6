"""Latch-up of the memories: found by looking, cut at once, kept off until the host clears it."""

import pytest

from cubestack.firmware_model.cubesense.supply import OFF_TIME_US, OVER_CURRENT_MA, SAMPLE_US
from cubestack.firmware_model.interface.cubesense import codes, pins
from cubestack.firmware_model.mcu.requests import Request, SetPin, Sleep

from .harness import Harness


def over_current(unit: Harness) -> set[codes.Sram]:
    power = unit.telemetry("Power")
    return {sram for sram in codes.Sram if power[f"OverCurrent{sram + 1}"]}


@pytest.mark.parametrize("sram", codes.Sram)
def test_idle_latch_up_is_cut_within_one_sample(unit: Harness, sram: codes.Sram) -> None:
    unit.log.clear()
    unit.latched.add(sram)
    start_us = unit.now_us
    unit.run(until_us=start_us + 2 * SAMPLE_US)
    (cut_us,) = (us for us, request in unit.log if request == SetPin(pins.SRAM_POWER[sram], 0))
    assert cut_us - start_us <= SAMPLE_US + 200
    assert unit.cut() == over_current(unit) == {sram}


@pytest.mark.parametrize("target", [codes.ResetTarget.CAMERAS, codes.ResetTarget.MCU])
def test_memories_are_monitored_in_every_wait(unit: Harness, target: codes.ResetTarget) -> None:
    """A reset of the cameras waits for 100 ms; one of the program, for the UART."""
    unit.backlog = 200
    latched_us: list[int] = []

    def latch(request: Request) -> None:
        if isinstance(request, Sleep) and not request.wakeable and not latched_us:
            latched_us.append(unit.now_us)
            unit.latched.add(codes.Sram.SRAM1)

    unit.log.clear()
    unit.i2c_write(bytes([0, target]))
    unit.on_request = latch
    unit.run()
    cut_us = next(us for us, request in unit.log if request == SetPin("SRAM1_POWER", 0))
    assert cut_us - latched_us[0] <= SAMPLE_US + 200


@pytest.mark.parametrize("cleared_after_us", [20_000, 500_000])
def test_it_is_off_for_a_while_at_least(unit: Harness, cleared_after_us: int) -> None:
    unit.log.clear()
    unit.latched.add(codes.Sram.SRAM2)
    unit.run(until_us=unit.now_us + cleared_after_us)
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.SRAM2)
    (off_us, _), (on_us, last) = ((us, r) for us, r in unit.log if isinstance(r, SetPin))
    assert last == SetPin("SRAM2_POWER", 1)
    assert on_us - off_us == pytest.approx(max(OFF_TIME_US, cleared_after_us), abs=SAMPLE_US + 1000)
    assert on_us - off_us >= OFF_TIME_US


def test_two_memories_wait_for_the_one_that_was_cut_last(unit: Harness) -> None:
    unit.log.clear()
    for sram in codes.Sram:
        unit.latched.add(sram)
        unit.run(until_us=unit.now_us + OFF_TIME_US // 2)
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.BOTH)
    for sram in codes.Sram:
        pin = pins.SRAM_POWER[sram]
        off_us, on_us = (us for us, r in unit.log if isinstance(r, SetPin) and r.pin == pin)
        assert on_us - off_us >= OFF_TIME_US


def test_a_lasting_latch_up_is_cut_again(unit: Harness) -> None:
    unit.latched.add(codes.Sram.SRAM1)
    unit.latch_on(SetPin(pins.SRAM_POWER[codes.Sram.SRAM1], 1), codes.Sram.SRAM1)
    unit.run(until_us=unit.now_us + 10_000)
    unit.log.clear()
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.SRAM1)
    unit.run(until_us=unit.now_us + 10_000)
    switched = [request for _, request in unit.log if isinstance(request, SetPin)]
    assert switched == [SetPin("SRAM1_POWER", 1), SetPin("SRAM1_POWER", 0)]
    assert over_current(unit) == {codes.Sram.SRAM1}


def test_clearing_does_not_touch_a_memory_that_works(unit: Harness) -> None:
    unit.command("CaptureOnly", Camera=codes.Camera.SUN, Sram=codes.Sram.SRAM1)
    kept = unit.memories[codes.Sram.SRAM1].copy()
    unit.log.clear()
    start_us = unit.now_us
    unit.command("ClearOverCurrent", Selection=codes.SramSelection.BOTH)
    assert (unit.memories[codes.Sram.SRAM1] == kept).all()
    assert not any(isinstance(request, SetPin) for _, request in unit.log)
    assert unit.now_us - start_us < SAMPLE_US + 1_000


@pytest.mark.parametrize(("ma", "cut"), [(OVER_CURRENT_MA - 1, False), (OVER_CURRENT_MA + 1, True)])
def test_over_current_limit(unit: Harness, ma: float, cut: bool) -> None:
    unit.memory_ma = ma
    unit.run(until_us=unit.now_us + 10_000)
    assert unit.cut() == (set(codes.Sram) if cut else set())


def test_currents_are_shown_to_a_tenth_within_the_converters_step(unit: Harness) -> None:
    power = unit.telemetry("Power")
    for monitor in pins.Monitor:
        ma = power[f"Current{monitor.replace('SRAM', 'Sram')}"]
        assert ma == pytest.approx(unit.supply_ma.get(monitor, unit.memory_ma), abs=0.16)
    unit.latched.add(codes.Sram.SRAM1)
    unit.run(until_us=unit.now_us + 10_000)
    assert unit.telemetry("Power")["CurrentSram1"] == 0
