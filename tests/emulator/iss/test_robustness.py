"""Faulty programs, random accesses and inputs: every run ends, and a crash's cause is known."""

import random
import time

import pytest

from cubestack.emulator.iss.insight.fault_report import last_fault
from cubestack.emulator.iss.machine import EXTERNAL_BASE, Machine
from cubestack.emulator.iss.outcome import OutgoingKind, StopReason
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from tests.tiers import quick

from .armv7m.thumb import Program
from .efm32gg.bench import MS, US, WFI, Bench, S, asleep
from .fuzz import CASES, RUNS_AT_MOST, Fuzz, disturb

EACH = 300
"""Images, and register set-ups; ``python -m tests.emulator.iss.fuzz`` runs more."""


@pytest.fixture(scope="module")
def machine(fuzz: Fuzz) -> Machine:
    return fuzz.machine


@pytest.fixture(scope="module")
def fuzz() -> Fuzz:
    return Fuzz()


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.parametrize("part", quick(range(4), 2))
def test_random_cases_run_to_their_time(fuzz: Fuzz, kind: str, part: int) -> None:
    for number in range(part, EACH, 4):
        CASES[kind](fuzz, number)


def program(text: str, stack: int = 0x2000_8000) -> bytes:
    """A program that ends in a loop, as does its hard fault handler."""
    return bytes(Program(f"{text}; b .; @3: b .", stack).image)


def outcome(fuzz: Fuzz, image: bytes) -> set[OutgoingKind]:
    """Kinds of messages in two milliseconds."""
    machine, begin = fuzz.machine, fuzz.start(image)
    kinds: set[OutgoingKind] = set()
    for _ in range(RUNS_AT_MOST):
        machine.run(begin + 2 * MS)
        kinds |= {one.kind for one in machine.outbox()}
        if machine.now_ps >= begin + 2 * MS:
            break
    return kinds


def test_empty_vector_table_locks_up_and_the_part_resets(fuzz):
    assert OutgoingKind.RESET in outcome(fuzz, b"")


def test_endless_loop_with_interrupts_off_ends_at_its_time(machine, fuzz):
    begin = fuzz.start(program("cpsid i"))
    assert machine.run(begin + MS).reason == StopReason.TIME
    assert machine.now_ps - begin >= MS


@pytest.mark.parametrize("on", [False, True])
def test_semihosting_can_be_switched_on(machine, fuzz, on):
    machine.semihosting(on)
    text = ".org 0x600; .short 0x6968, 0x0021; .org 0x400"
    # SYS_WRITE0
    begin = fuzz.start(program(f"{text}; ldr r1, =0x600; movs r0, #4; bkpt #0xAB"))
    machine.run(begin + MS)
    calls = [one for one in machine.outbox() if one.kind is OutgoingKind.SEMIHOSTING]
    assert [(one.unit, one.value) for one in calls] == ([(4, 0x600)] if on else [])
    machine.answer_call(0)
    assert machine.register("xpsr") & 0x1FF == (0 if on else 3)
    machine.semihosting(False)


def test_lock_up_stops_the_run_before_the_part_resets(machine, fuzz):
    image = bytes(Program(".org 12; .short 1, 0x3000; .org 0x400; udf #0").image)
    begin = fuzz.start(image)
    assert machine.run(begin + MS).reason == StopReason.LOCKED_UP
    assert machine.register("pc") == 0x3000_0000
    assert OutgoingKind.RESET in outcome(fuzz, image)
    assert last_fault(machine).exception == 0  # still known after the reset
    assert last_fault(machine).pc == 0x3000_0000


@pytest.mark.parametrize(
    "base", [0x4000_0000, 0x400C_0000, 0xE000_0000, EXTERNAL_BASE, 0x1000_0000]
)
def test_every_word_of_a_block_can_be_read_and_written(machine, fuzz, base):
    fuzz.start(program(""))
    for offset in range(0, 0x10000, 4):
        for value in (0, 0xFFFF_FFFF):
            machine.write(base + offset, value)
            machine.read(base + offset)
        machine.peek(base + offset, 4)
    list(machine.outbox())
    assert machine.run(machine.now_ps + MS).now_ps > 0


# -- accesses to registers without a program --

UNITS = {"USART", "LEUART", "I2C", "TIMER", "LETIMER", "RTC", "BURTC", "PCNT", "ADC", "DAC", "ACMP",
         "VCMP", "DMA", "PRS", "GPIO", "AES", "LESENSE"}  # fmt: skip
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


def test_run_ends_soon_while_the_memory_protection_changes_all_the_time(fuzz: Fuzz) -> None:
    loop = "again: str r1, [r0]; str r2, [r0]; b again"
    begin = fuzz.start(program(f"ldr r0, =0xE000ED94; movs r1, #5; movs r2, #4; {loop}"))
    before = fuzz.machine.instructions
    fuzz.run(begin + 1000 * MS)
    assert 100 < fuzz.machine.instructions - before < 10_000
