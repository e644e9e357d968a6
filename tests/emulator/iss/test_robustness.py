"""Faulty programs: every run ends, and the cause of a crash is known."""

import os
import random
import struct
from collections.abc import Iterator

import pytest

from cubestack.emulator.iss.insight.fault_report import last_fault
from cubestack.emulator.iss.machine import EXTERNAL_BASE, RAM_BASE, Machine
from cubestack.emulator.iss.outcome import OutgoingKind, StopReason

from .wild_images import KINDS, START, make

MILLISECOND = 1_000_000_000
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
    what = chance.randrange(7)
    if what == 0:
        machine.pin(chance.randrange(6), chance.randrange(16), chance.randrange(2))
    elif what == 1:
        machine.uart_receive(chance.randrange(7), chance.getrandbits(9), chance.randrange(4))
    elif what == 2:
        machine.i2c_slave_start(chance.randrange(2), chance.getrandbits(8))
    elif what == 3:
        machine.i2c_slave_write(chance.randrange(2), chance.getrandbits(8))
    elif what == 4:
        machine.i2c_slave_read(chance.randrange(2))
    elif what == 5:
        machine.i2c_answer(chance.randrange(2), chance.random() < 0.5, chance.getrandbits(8))
    else:
        machine.analog[:] = [chance.uniform(-5, 5) for _ in machine.analog]
        machine.analog_changed()


@pytest.mark.parametrize("kind", KINDS)
def test_random_images_run_to_their_time(machine, kind):
    for seed in range(SEEDS // len(KINDS)):
        chance = random.Random(f"{kind} {seed}")
        begin = start(machine, make(kind, chance))
        for _ in range(RUNS_AT_MOST):
            if chance.random() < 0.2:
                disturb(machine, chance)
            step = chance.choice((1, 1000, 100_000, MILLISECOND))
            until = min(begin + MILLISECOND, machine.now_ps + step)
            stop = machine.run(until)
            stopped = list(machine.outbox()) or stop.reason is not StopReason.TIME
            assert stop.now_ps >= until or stopped
            if machine.now_ps >= begin + MILLISECOND:
                break
        assert len(machine.registers()) == 23


def program(*halves: int, vectors: dict[int, int] | None = None, stack: int = 0x2000_8000) -> bytes:
    """Half-words at START; other handlers loop at their end."""
    table = [stack, START | 1, *[START + 2 * len(halves) | 1] * 62]
    for number, value in (vectors or {}).items():
        table[number] = value
    code = struct.pack(f"<{len(halves) + 1}H", *halves, 0xE7FE)
    return struct.pack("<64I", *table).ljust(START, b"\xff") + code


def outcome(machine: Machine, image: bytes) -> set[OutgoingKind]:
    """Kinds of messages in two milliseconds."""
    begin = start(machine, image)
    kinds: set[OutgoingKind] = set()
    for _ in range(RUNS_AT_MOST):
        machine.run(begin + 2 * MILLISECOND)
        kinds |= {one.kind for one in machine.outbox()}
        if machine.now_ps >= begin + 2 * MILLISECOND:
            break
    return kinds


def test_empty_vector_table_locks_up_and_the_part_resets(machine):
    assert OutgoingKind.RESET in outcome(machine, b"")


def test_jump_to_an_unused_address_is_a_hard_fault(machine):
    outcome(machine, program(0xF04F, 0x5040, 0x3001, 0x4700))  # MOV.W r0, #0x30000000; ADDS; BX
    assert machine.register("xpsr") & 0x1FF == 3


def test_stack_overflow_is_a_hard_fault(machine):
    # PUSH {r0-r7, lr}; B there
    outcome(machine, program(0xB5FF, 0xE7FD, stack=RAM_BASE + 64))
    assert machine.register("xpsr") & 0x1FF == 3


def test_endless_loop_with_interrupts_off_ends_at_its_time(machine):
    begin = start(machine, program(0xB672, 0xE7FE))
    assert machine.run(begin + MILLISECOND).reason == StopReason.TIME
    assert machine.now_ps - begin >= MILLISECOND


@pytest.mark.parametrize("on", [False, True])
def test_semihosting_can_be_switched_on(machine, on):
    machine.semihosting(on)
    # ADR r1, text; MOVS r0, #4 (SYS_WRITE0); BKPT 0xAB; B here; the text
    begin = start(machine, program(0xA101, 0x2004, 0xBEAB, 0xE7FE, 0x6968, 0x0021))
    machine.run(begin + MILLISECOND)
    text = [one.text for one in machine.outbox() if one.kind is OutgoingKind.SEMIHOSTING]
    assert text == (["hi!"] if on else [])
    assert machine.register("xpsr") & 0x1FF == (0 if on else 3)
    machine.semihosting(False)


def test_lock_up_stops_the_run_before_the_part_resets(machine):
    image = program(0xDE00, vectors={3: 0x3000_0001})
    begin = start(machine, image)
    assert machine.run(begin + MILLISECOND).reason == StopReason.LOCKED_UP
    assert machine.register("pc") == 0x3000_0000
    assert OutgoingKind.RESET in outcome(machine, image)
    assert last_fault(machine).exception == 0  # still known after the reset
    assert last_fault(machine).pc == 0x3000_0000


@pytest.mark.parametrize(
    "base", [0x4000_0000, 0x400C_0000, 0xE000_0000, EXTERNAL_BASE, 0x1000_0000]
)
def test_every_word_of_a_block_can_be_read_and_written(machine, base):
    start(machine, program(0xE7FE))
    for offset in range(0, 0x10000, 4):
        for value in (0, 0xFFFF_FFFF):
            machine.write(base + offset, value)
            machine.read(base + offset)
        machine.peek(base + offset, 4)
    list(machine.outbox())
    assert machine.run(machine.now_ps + MILLISECOND).now_ps > 0
