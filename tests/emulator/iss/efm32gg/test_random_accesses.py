"""Random writes to all registers and random inputs: time passes, and no run hangs or crashes."""

import random
import time

import pytest

from cubestack.firmware_model.interface.efm32gg import LAYOUTS

from .bench import MS, US, WFI, Bench, S, asleep

UNITS = {"USART", "LEUART", "I2C", "TIMER", "LETIMER", "RTC", "BURTC", "PCNT", "ADC", "DAC", "ACMP",
         "VCMP", "DMA", "PRS", "GPIO"}  # fmt: skip
ALL, INTERFACES = (
    [
        (instance.base + register.offset, register.writable)
        for layout in LAYOUTS
        if units is None or layout.name in units
        for instance in layout.instances
        if instance.base >= 0x4000_0000
        for register in layout.registers
        if units is None or not register.name.startswith("RET")
    ]
    for units in (None, UNITS)
)
MOST_STOPS = 2000
"""Of a run of 50 ms; more stops mean that time does not advance."""
PATIENCE_S = 20


def run_until(bench: Bench, until_ps: int) -> None:
    for _ in range(MOST_STOPS):
        before = bench.now
        if before >= until_ps:
            return
        bench.machine.run(until_ps)
        list(bench.machine.outbox())
        assert bench.now >= before
    pytest.fail(f"time stays at {bench.now} ps")


@pytest.mark.parametrize("seed", range(8))
def test_time_passes_after_random_writes_to_any_register(seed: int) -> None:
    rng = random.Random(seed)
    bench = Bench() if seed % 2 else Bench(0xB672, WFI, 0xE7FD)
    bench.load("CMU", HFPERCLKEN0=0xFFFF_FFFF, HFCORECLKEN0=0xFFFF_FFFF, OSCENCMD=0x155)
    for _ in range(150):
        address, writable = rng.choice(ALL)
        if rng.random() < 0.7:
            sparse = rng.getrandbits(32) & rng.getrandbits(32)
            value = rng.choice([rng.getrandbits(32), 1 << rng.randrange(32), writable, sparse])
            bench.machine.write(address, value, rng.choice([1, 2, 4]))
        else:
            bench.machine.read(address)
        if rng.random() < 0.2:
            bench.machine.pin(rng.randrange(6), rng.randrange(16), rng.randrange(-1, 2))
        if rng.random() < 0.1:
            run_until(bench, bench.now + rng.choice([US, 100 * US, MS, 50 * MS]))


@pytest.mark.parametrize("seed", range(12))
def test_time_passes_after_random_writes_and_inputs_of_interfaces(seed: int) -> None:
    rng = random.Random(seed)
    bench = asleep(1) if seed % 2 else Bench()
    machine = bench.machine
    bench.load("CMU", HFPERCLKEN0=0xFFFF_FFFF, HFCORECLKEN0=0xFFFF_FFFF)
    bench.command("CMU.OSCENCMD.LFRCOEN")
    bench.load("CMU", LFACLKEN0=0xFF, LFBCLKEN0=0xFF).load("RMU", CTRL=0)
    bench.run_for(S // 1000)
    machine.poke(0x2000_0000, rng.randbytes(4096))
    began, wall = bench.now, time.monotonic()
    for _ in range(600):
        match rng.randrange(8):
            case 0:
                machine.uart_receive(rng.randrange(8), rng.randrange(512), rng.randrange(4))
            case 1:
                machine.pin(rng.randrange(6), rng.randrange(16), rng.randrange(-1, 2))
            case 2:
                machine.analog[rng.randrange(27)] = rng.uniform(-1, 5)
                machine.analog_changed()
            case 3:
                unit = rng.randrange(2)
                getattr(machine, rng.choice(("i2c_slave_stop", "i2c_slave_poll")))(unit)
                machine.i2c_slave_start(unit, rng.randrange(256))
                machine.i2c_slave_write(unit, rng.randrange(256))
                machine.i2c_slave_read(unit, rng.random() < 0.5)
                machine.i2c_answer(unit, rng.random() < 0.5, rng.randrange(256))
            case 4:
                bench.run_for(rng.randrange(20) * US)
            case _:
                address, writable = rng.choice(INTERFACES)
                machine.write(address, rng.getrandbits(32) & rng.getrandbits(32) & writable)
                machine.read(rng.choice(INTERFACES)[0])
        assert time.monotonic() - wall < PATIENCE_S
    assert bench.now > began
