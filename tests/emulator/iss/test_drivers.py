"""Drivers in a vendor's style, one per peripheral; each verifies its own results."""

from collections.abc import Callable
from pathlib import Path

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind
from tests.emulator.iss.cross_compiler import binary_of, compile_for_m3, needs_compiler
from tests.tiers import quick

from .efm32gg.bench import MS, US
from .test_programs import PROGRAMS, Console

DRIVERS = Path(__file__).parent / "drivers"
ACMP0_INPUTS, VDD = 10, 9
SUPPLY_V = 3.3
DEVICE = 0xA0

pytestmark = needs_compiler

Stimulus = Callable[[Console], None]


def nothing(bench: Console) -> None:
    """The driver needs no inputs."""


def started(bench: Console) -> None:
    while not bench.text.endswith("go\n"):
        assert bench.now < 100 * MS, bench.text
        bench.run_for(100 * US)


def comparator_input(bench: Console) -> None:
    started(bench)
    for volts in (1.8, 1.5, 3.3, 0.0, 1.7, 1.6):
        bench.machine.analog[ACMP0_INPUTS + 2] = volts
        bench.machine.analog_changed()
        bench.run_for(100 * US)


def supply(bench: Console) -> None:
    started(bench)
    for volts in (2.6, 2.7, 2.4, 3.3):
        bench.machine.analog[VDD] = volts
        bench.machine.analog_changed()
        bench.run_for(100 * US)


def pulses(bench: Console) -> None:
    started(bench)
    for _ in range(25):
        for level in (1, 0):
            bench.machine.pin(2, 13, level)
            bench.run_for(100 * US)


def voltages(bench: Console) -> None:
    bench.machine.analog[:4] = (0.33, 1.0, 1.65, 3.0)


def sensors(bench: Console) -> None:
    for channel in range(8):
        bench.machine.analog[ACMP0_INPUTS + channel] = 3.0 if 0x65 >> channel & 1 else 0.1
    bench.machine.analog_changed()


def device(bench: Console) -> None:
    """A device with 256 registers; the first byte written is the number of one."""
    registers, at, expects_number = bytearray(256), 0, True
    while not bench.text.endswith(("ok\n", "failed\n")):
        assert bench.now < 200 * MS, bench.text
        bench.run_for(20 * US)
        for kind in (OutgoingKind.I2C_START, OutgoingKind.I2C_WRITE, OutgoingKind.I2C_READ):
            for item in bench.out(kind):
                answered, data = True, 0
                if kind is OutgoingKind.I2C_START:
                    answered, expects_number = item.value & 0xFE == DEVICE, True
                elif kind is OutgoingKind.I2C_READ:
                    data, at = registers[at], at + 1
                elif expects_number:
                    at, expects_number = item.value, False
                else:
                    registers[at], at = item.value, at + 1
                bench.machine.i2c_answer(0, answered, data)


STIMULI: dict[str, Stimulus] = {
    "acmp": comparator_input,
    "adc": voltages,
    "aes": nothing,
    "dac": nothing,
    "i2c_master": device,
    "lesense": sensors,
    "letimer": nothing,
    "leuart": nothing,
    "msc": nothing,
    "pcnt": pulses,
    "timer_dma": nothing,
    "vcmp": supply,
    "wdog": nothing,
}


def test_each_driver_has_its_inputs() -> None:
    assert sorted(STIMULI) == sorted(path.stem for path in DRIVERS.glob("*.c"))


@pytest.fixture(scope="module")
def startup(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("drivers") / "startup.o"
    compile_for_m3("-O2", "-ffreestanding", "-c", PROGRAMS / "startup.c", "-o", target)
    return target


@pytest.mark.parametrize("option", quick(["-O2", "-O0", "-Os"], 1))
@pytest.mark.parametrize("name", STIMULI)
def test_driver_finds_the_values_that_it_expects(
    name: str, option: str, startup: Path, tmp_path: Path
) -> None:
    elf = tmp_path / "driver.elf"
    flags = option, "-ffreestanding", "-nostdlib", "-I", PROGRAMS, "-T", PROGRAMS / "device.ld"
    compile_for_m3(*flags, startup, DRIVERS / f"{name}.c", "-lgcc", "-o", elf)
    bench = Console(image=binary_of(elf))
    bench.machine.analog[VDD] = SUPPLY_V
    bench.machine.analog_changed()
    STIMULI[name](bench)
    while not bench.text.endswith(("ok\n", "failed\n")):
        assert bench.now < 400 * MS, bench.text
        bench.run_for(1 * MS)
    assert bench.text.removeprefix("go\n") == "ok\n"
