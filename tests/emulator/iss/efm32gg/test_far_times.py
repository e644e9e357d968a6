"""Times beyond what the clock can represent: they never come, and nothing waits for them."""

import random
import time

import pytest

from cubestack.emulator.iss.machine import NEVER
from cubestack.emulator.iss.outcome import OutgoingKind
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from tests.together import together

from .bench import LOOP, MS, US, WFI, Bench, S, address_of, asleep

COUNTERS = ("TIMER", "LETIMER", "RTC", "BURTC", "WDOG")
CLOCKS = ("CMU", "RMU")
REGISTERS = [
    (f"{instance.name}.{register.name}", register.writable)
    for layout in LAYOUTS
    if layout.name in (*COUNTERS, *CLOCKS)
    for instance in layout.instances
    for register in layout.registers
    if register.writable and not register.name.startswith("RET")
]
MOST_RUNS = 60
"""Calls for 1 s of virtual time, of which each does a bounded amount of work."""

PATIENCE_S = 0.5
"""Wall time of one call: a call that freezes takes longer, one on a slow machine does not."""


def low_energy(bench: Bench) -> Bench:
    """LFRCO ready, all clocks on, the backup domain out of reset."""
    bench.clock("LE").load("CMU", HFPERCLKEN0=0xFFFF_FFFF, OSCENCMD=0x40)
    bench.run_for(MS)
    return bench.load("CMU", LFCLKSEL=5, LFACLKEN0=0xF, LFBCLKEN0=3).load("RMU", CTRL=0)


@pytest.mark.parametrize(
    "setup",
    [
        pytest.param({"CMU.LFAPRESC0": 15 << 4, "RTC.IEN": 1, "RTC.CTRL": 1}, id="RTC at 1 Hz"),
        pytest.param(
            {"CMU.LFAPRESC0": 15 << 4, "RTC.IEN": 6, "RTC.COMP0": 0xFF_FFFF, "RTC.CTRL": 1},
            id="RTC compare at 1 Hz",
        ),
        pytest.param({"BURTC.IEN": 1, "BURTC.CTRL": 1 | 1 << 12 | 7 << 8}, id="BURTC at 256 Hz"),
        pytest.param({"BURTC.IEN": 1, "BURTC.CTRL": 1 | 3 << 12 | 7 << 8}, id="BURTC at 1 kHz"),
    ],
)
def test_event_in_the_far_future_does_not_stop_time(setup: dict[str, int]) -> None:
    bench = low_energy(Bench())
    for register, value in setup.items():
        bench[register] = value
        bench.run_for(MS)
    began = bench.now
    bench.machine.run(began + 10 * MS)
    assert bench.now >= began + 10 * MS


def test_far_event_is_due_never() -> None:
    bench = low_energy(asleep(1, interrupts=False))
    bench.load("BURTC", IEN=1, CTRL=1 | 1 << 12 | 7 << 8)
    bench.run_for(MS)
    assert bench.machine.next_event_ps == NEVER


def random_set_up(rng: random.Random) -> Bench:
    """Counters and clocks with random contents; the program loops or sleeps."""
    bench = low_energy(Bench(LOOP) if rng.random() < 0.5 else Bench(0xB672, WFI, 0xE7FD))
    bench.machine.write(0xE000_ED10, rng.choice((0, 4)))
    chosen = rng.sample(COUNTERS, rng.randrange(1, 4))
    for name, writable in rng.sample(REGISTERS, len(REGISTERS)):
        unit = name.split(".")[0].rstrip("0123456789")
        if unit in chosen or (unit in CLOCKS and rng.random() < 0.3):
            value = rng.choice((rng.getrandbits(32), writable, 0, 1 << rng.randrange(32)))
            bench.machine.write(address_of(name), value & writable)
        if rng.random() < 0.1:
            bench.run_for(rng.choice((US, 100 * US)))
    return bench


@together("seed", range(60))
def test_counters_with_random_registers_run_in_bounded_work(seed: int) -> None:
    bench = random_set_up(random.Random(seed))
    until = bench.now + S // 20
    for _ in range(MOST_RUNS):
        before, began = bench.now, time.perf_counter()
        bench.machine.run(until)
        assert time.perf_counter() - began < PATIENCE_S
        resets = any(one.kind is OutgoingKind.RESET for one in bench.machine.outbox())
        assert bench.now > before or resets or bench.machine.asleep or bench.now >= until
        if bench.now >= until or resets:
            return
