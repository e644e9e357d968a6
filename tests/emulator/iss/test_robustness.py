"""Faulty programs, random accesses and inputs: every run ends, and a crash's cause is known."""

import os
import random
import time
from collections.abc import Iterator

import pytest

from cubestack.emulator.iss.insight.fault_report import last_fault
from cubestack.emulator.iss.machine import EXTERNAL_BASE, RAM_BASE, Machine
from cubestack.emulator.iss.outcome import OutgoingKind, StopReason
from cubestack.firmware_model.interface.efm32gg import LAYOUTS

from .armv7m.thumb import Program
from .efm32gg.bench import MS, US, WFI, Bench, S, asleep
from .wild_images import KINDS

RUNS_AT_MOST = 3000
"""Runs per millisecond; a program that keeps resetting the part stops often."""

SEEDS = int(os.environ.get("CUBESTACK_WILD_IMAGES", "600"))
"""How many images; 10 000 have been run, with and without -fsanitize=address,undefined."""


@pytest.fixture(scope="module")
def machine() -> Iterator[Machine]:
    made = Machine(external_bytes=1 << 20)
    made.analog[8:10] = 25, 3.3
    yield made
    made.close()


def start(machine: Machine, image: bytes) -> int:
    """Load an image and reset; returns the time."""
    machine.flash[:] = 0xFF
    machine.flash[: len(image)] = memoryview(image)
    machine.ram[:] = 0
    machine.invalidate(0, machine.flash.size)
    machine.invalidate(RAM_BASE, machine.ram.size)
    machine.reset()
    list(machine.outbox())
    return machine.now_ps


def disturb(machine: Machine, chance: random.Random) -> None:
    """Apply one random input."""
    unit, byte = chance.randrange(2), chance.getrandbits(8)
    match chance.randrange(8):
        case 0:
            machine.pin(chance.randrange(6), chance.randrange(16), chance.randrange(-1, 2))
        case 1:
            machine.uart_receive(chance.randrange(8), chance.getrandbits(9), chance.randrange(4))
        case 2:
            machine.i2c_slave_start(unit, byte)
        case 3:
            machine.i2c_slave_write(unit, byte)
        case 4:
            machine.i2c_slave_read(unit, chance.random() < 0.5)
        case 5:
            machine.i2c_answer(unit, chance.random() < 0.5, byte)
        case 6:
            chance.choice((machine.i2c_slave_stop, machine.i2c_slave_poll))(unit)
        case 7:
            machine.analog[:] = [chance.uniform(-5, 5) for _ in machine.analog]
            machine.analog_changed()


@pytest.mark.parametrize("kind", KINDS)
def test_random_images_run_to_their_time(machine, kind):
    for seed in range(SEEDS // len(KINDS)):
        chance = random.Random(f"{kind} {seed}")
        begin = start(machine, KINDS[kind](chance))
        for _ in range(RUNS_AT_MOST):
            if chance.random() < 0.2:
                disturb(machine, chance)
            step = chance.choice((1, 1000, 100_000, MS))
            until = min(begin + MS, machine.now_ps + step)
            stop = machine.run(until)
            stopped = list(machine.outbox()) or stop.reason is not StopReason.TIME
            assert stop.now_ps >= until or stopped
            if machine.now_ps >= begin + MS:
                break
        assert len(machine.registers()) == 23


def program(text: str, stack: int = 0x2000_8000) -> bytes:
    """A program that ends in a loop, as does its hard fault handler."""
    return bytes(Program(f"{text}; b .; @3: b .", stack).image)


def outcome(machine: Machine, image: bytes) -> set[OutgoingKind]:
    """Kinds of messages in two milliseconds."""
    begin = start(machine, image)
    kinds: set[OutgoingKind] = set()
    for _ in range(RUNS_AT_MOST):
        machine.run(begin + 2 * MS)
        kinds |= {one.kind for one in machine.outbox()}
        if machine.now_ps >= begin + 2 * MS:
            break
    return kinds


def test_empty_vector_table_locks_up_and_the_part_resets(machine):
    assert OutgoingKind.RESET in outcome(machine, b"")


def test_endless_loop_with_interrupts_off_ends_at_its_time(machine):
    begin = start(machine, program("cpsid i"))
    assert machine.run(begin + MS).reason == StopReason.TIME
    assert machine.now_ps - begin >= MS


@pytest.mark.parametrize("on", [False, True])
def test_semihosting_can_be_switched_on(machine, on):
    machine.semihosting(on)
    text = ".org 0x600; .short 0x6968, 0x0021; .org 0x400"
    # SYS_WRITE0
    begin = start(machine, program(f"{text}; ldr r1, =0x600; movs r0, #4; bkpt #0xAB"))
    machine.run(begin + MS)
    calls = [one for one in machine.outbox() if one.kind is OutgoingKind.SEMIHOSTING]
    assert [(one.unit, one.value) for one in calls] == ([(4, 0x600)] if on else [])
    machine.answer_call(0)
    assert machine.register("xpsr") & 0x1FF == (0 if on else 3)
    machine.semihosting(False)


def test_lock_up_stops_the_run_before_the_part_resets(machine):
    image = bytes(Program(".org 12; .short 1, 0x3000; .org 0x400; udf #0").image)
    begin = start(machine, image)
    assert machine.run(begin + MS).reason == StopReason.LOCKED_UP
    assert machine.register("pc") == 0x3000_0000
    assert OutgoingKind.RESET in outcome(machine, image)
    assert last_fault(machine).exception == 0  # still known after the reset
    assert last_fault(machine).pc == 0x3000_0000


@pytest.mark.parametrize(
    "base", [0x4000_0000, 0x400C_0000, 0xE000_0000, EXTERNAL_BASE, 0x1000_0000]
)
def test_every_word_of_a_block_can_be_read_and_written(machine, base):
    start(machine, program(""))
    for offset in range(0, 0x10000, 4):
        for value in (0, 0xFFFF_FFFF):
            machine.write(base + offset, value)
            machine.read(base + offset)
        machine.peek(base + offset, 4)
    list(machine.outbox())
    assert machine.run(machine.now_ps + MS).now_ps > 0


# -- accesses to registers without a program --

UNITS = {"USART", "LEUART", "I2C", "TIMER", "LETIMER", "RTC", "BURTC", "PCNT", "ADC", "DAC", "ACMP",
         "VCMP", "DMA", "PRS", "GPIO", "AES"}  # fmt: skip
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
def test_machine_runs_on_after_random_register_writes(seed: int) -> None:
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
            disturb(bench.machine, rng)
        if rng.random() < 0.1:
            run_until(bench, bench.now + rng.choice([US, 100 * US, MS, 50 * MS]))


@pytest.mark.parametrize("seed", range(12))
def test_machine_runs_on_after_random_interface_writes_and_inputs(seed: int) -> None:
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
        if rng.random() < 0.5:
            disturb(machine, rng)
        elif rng.random() < 0.25:
            bench.run_for(rng.randrange(20) * US)
        else:
            address, writable = rng.choice(INTERFACES)
            machine.write(address, rng.getrandbits(32) & rng.getrandbits(32) & writable)
            machine.read(rng.choice(INTERFACES)[0])
        assert time.monotonic() - wall < PATIENCE_S
    assert bench.now > began
