"""The loop marks instructions whose fetch is free; under an observer it asks the cache each time.

Both take the same cycles, with every setting of the flash controller (EFM32GG Reference Manual,
MSC_READCTRL), also when code, breakpoints or the cache change on the way.
"""

import random

import pytest

from cubestack.emulator.iss.insight.observer import Observer
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from tests.emulator.iss.fuzz import MS
from tests.emulator.iss.wild_images import KINDS

READCTRL, CACHE, CACHE_HITS = 0x400C_0004, 0x400C_0040, 0x400C_0044
MODES = (0, 1, 2)  # WS0, WS1, WS1SCBTP
CACHE_OFF, PREFETCH = 1 << 3, 1 << 8
COMMANDS = (0, 0, 0, 1, 2, 4)  # INVCACHE, STARTPC, STOPPC
SLICES = 150


def state(machine: Machine) -> tuple[dict[str, int], int, int, int | None]:
    return machine.registers(), machine.cycles, machine.instructions, machine.read(CACHE_HITS)


@pytest.mark.parametrize("seed", range(12))
def test_both_loops_take_the_same_cycles_with_every_cache_setting(seed: int) -> None:
    chance = random.Random(seed)
    kinds = ("noise_that_starts", "short_instructions", "accesses", "one_peripheral")
    image = KINDS[kinds[seed % 4]](chance)
    machines = [Machine(), Machine()]
    for machine in machines:
        machine.flash[: len(image)] = memoryview(image)
        machine.invalidate(0, machine.flash.size)
        machine.reset()
    observer = Observer(machines[1], Symbols(None))
    for _ in range(SLICES):
        setting = chance.choice(MODES) | chance.choice((0, 0, CACHE_OFF))
        setting |= chance.choice((0, PREFETCH))
        command, changes = chance.choice(COMMANDS), chance.random()
        place, half = 0x400 + 2 * chance.randrange(0x100), chance.randbytes(2)
        until = max(machine.now_ps for machine in machines) + chance.choice((1, 1000, MS // 20))
        for machine in machines:
            if changes < 0.3:
                machine.write(READCTRL, setting)
                machine.write(CACHE, command)
            elif changes < 0.4:
                machine.poke(place, half)
            elif changes < 0.6:
                machine.breakpoints.add(place)
            elif changes < 0.7:
                machine.breakpoints.clear()
            machine.run(until)
            list(machine.outbox())
        assert state(machines[0]) == state(machines[1])
    assert machines[0].instructions > 20
    observer.close()
