"""Tests of the starter kit's firmware, for CI: `make`, then `pytest`.

The emulated microcontroller has nothing around it; the tests are its button and its serial host.
Time is virtual.
"""

from pathlib import Path

import pytest

HERE = Path(__file__).parent
APP, UNIT_TESTS = str(HERE / "app.elf"), str(HERE / "unit_tests.elf")
BUTTON, LED = "PB9", "PE2"


@pytest.mark.cubestack(firmware=UNIT_TESTS, semihosting=True)
def test_unit_tests_on_the_target(efm32gg):
    ended = efm32gg.run_to_exit(timeout_s=5)
    assert ended.status == 0, ended.output


@pytest.mark.cubestack(firmware=APP)
def test_button_switches_the_led(efm32gg):
    port = efm32gg.serial(timeout=0.1)
    assert port.readline() == b"ready\n"
    efm32gg.pins[BUTTON] = 0  # pressed
    efm32gg.pins.wait_for(LED, 1, timeout_s=0.01)
    assert port.readline() == b"on\n"
    del efm32gg.pins[BUTTON]  # released: the pull-up takes over
    efm32gg.wait(0.02)
    assert efm32gg.pins.output(LED) == 1


@pytest.mark.cubestack(firmware=APP)
def test_bounces_are_one_press(efm32gg):
    efm32gg.wait(0.01)
    for _ in range(3):
        efm32gg.pins[BUTTON] = 0
        efm32gg.wait(0.003)
        efm32gg.pins[BUTTON] = 1
        efm32gg.wait(0.002)
    assert efm32gg.pins.output(LED) == 0
    efm32gg.pins[BUTTON] = 0
    efm32gg.pins.wait_for(LED, 1, timeout_s=0.01)


@pytest.mark.cubestack(firmware=APP, stimulus=str(HERE / "press.vcd"))
def test_two_presses_from_a_file(efm32gg):
    port = efm32gg.serial(timeout=0.2)
    assert [port.readline() for _ in range(3)] == [b"ready\n", b"on\n", b"off\n"]


@pytest.mark.cubestack(firmware=APP)
def test_answers_after_a_brown_out(efm32gg):
    port = efm32gg.serial(timeout=0.1)
    assert port.readline() == b"ready\n"
    efm32gg.faults.inject("processor-reset", target="brown-out")
    assert port.readline() == b"ready\n"
    port.write(b"?")
    assert port.readline() == b"off\n"
