"""Anything may be written anywhere, and pins may do what they like: time goes on."""

import random

import pytest

from cubestack.firmware_model.interface.efm32gg import LAYOUTS

from .bench import MS, US, WFI, Bench

REGISTERS = [
    (instance.base + register.offset, register.writable)
    for layout in LAYOUTS
    for instance in layout.instances
    for register in layout.registers
    if instance.base >= 0x4000_0000
]
MOST_STOPS = 2000
"""Of a run of 50 ms; more is standing still."""


def wild_value(rng: random.Random, writable: int) -> int:
    sparse = rng.getrandbits(32) & rng.getrandbits(32)
    return rng.choice([rng.getrandbits(32), 1 << rng.randrange(32), writable, sparse])


@pytest.mark.parametrize("seed", range(8))
def test_time_goes_on_whatever_is_written(seed: int) -> None:
    rng = random.Random(seed)
    bench = Bench() if seed % 2 else Bench(0xB672, WFI, 0xE7FD)
    machine = bench.machine
    bench["CMU.HFPERCLKEN0"] = bench["CMU.HFCORECLKEN0"] = 0xFFFF_FFFF
    bench["CMU.OSCENCMD"] = 0x155
    for _ in range(150):
        address, writable = rng.choice(REGISTERS)
        if rng.random() < 0.7:
            machine.write(address, wild_value(rng, writable), rng.choice([1, 2, 4]))
        else:
            machine.read(address)
        if rng.random() < 0.2:
            machine.pin(rng.randrange(6), rng.randrange(16), rng.randrange(-1, 2))
        if rng.random() < 0.1:
            until, stops = bench.now + rng.choice([US, 100 * US, MS, 50 * MS]), 0
            while machine.now_ps < until:
                before = machine.now_ps
                machine.run(until)
                list(machine.outbox())
                assert machine.now_ps >= before
                stops += 1
                assert stops < MOST_STOPS
