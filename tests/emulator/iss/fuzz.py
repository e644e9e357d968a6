"""Random images and random register set-ups: no crash, and no run so long that an interrupt waits.

``python -m tests.emulator.iss.fuzz images|registers FIRST COUNT`` prints figures. A case depends on
its number alone. docs/simulator.md has the command for a sanitized library.
"""

import random
import sys
import time
from collections.abc import Callable

from cubestack.emulator.iss.machine import RAM_BASE, Machine
from cubestack.emulator.iss.outcome import StopReason
from cubestack.firmware_model.interface.efm32gg import LAYOUTS

from .wild_images import CLOCKS_ON, KINDS, one_line_program

MS = 10**9
RUNS_AT_MOST = 3000
"""Runs per millisecond; a program that keeps resetting the part stops often."""

LONGEST_S = 0.1
"""Processor time of one run: an interrupt is handled between two."""


class Fuzz:
    """A machine for many cases.

    Attributes:
        longest_s: processor time of the longest run so far.
    """

    def __init__(self) -> None:
        self.machine = Machine(external_bytes=1 << 20)
        self.machine.analog[8:10] = 25, 3.3
        self.longest_s = 0.0

    def start(self, image: bytes) -> int:
        """Load an image and reset; returns the time."""
        machine = self.machine
        machine.flash[:] = 0xFF
        machine.flash[: len(image)] = memoryview(image)
        machine.ram[:] = 0
        machine.invalidate(0, machine.flash.size)
        machine.invalidate(RAM_BASE, machine.ram.size)
        machine.reset()
        list(machine.outbox())
        return machine.now_ps

    def run(self, until_ps: int) -> None:
        """Run once; AssertionError if the run ends without a reason or takes too long."""
        began_s = time.thread_time()
        stop = self.machine.run(until_ps)
        taken_s = time.thread_time() - began_s
        self.longest_s = max(self.longest_s, taken_s)
        said = list(self.machine.outbox())
        ended = stop.now_ps >= until_ps or said or stop.reason is not StopReason.TIME
        assert ended or self.machine.now_ps < until_ps
        assert taken_s < LONGEST_S, f"a run of {taken_s:.3f} s"

    def run_case(self, chance: random.Random, begin_ps: int, for_ps: int) -> None:
        """Run for a time in random slices, with random inputs between them."""
        end_ps = begin_ps + for_ps
        for _ in range(RUNS_AT_MOST):
            if chance.random() < 0.2:
                disturb(self.machine, chance)
            step = chance.choice((1, 1000, 100_000, MS)) * for_ps // MS
            self.run(min(end_ps, self.machine.now_ps + max(step, 1)))
            if self.machine.now_ps >= end_ps:
                break
        assert len(self.machine.registers()) == 23

    def image(self, number: int) -> None:
        """A random image, for a millisecond."""
        chance = random.Random(f"image {number}")
        kind = tuple(KINDS)[number % len(KINDS)]
        self.run_case(chance, self.start(KINDS[kind](chance)), MS)

    def registers(self, number: int) -> None:
        """Random contents of one to three peripherals with clocks on, for 1 to 50 ms."""
        chance = random.Random(f"registers {number}")
        begin = self.start(one_line_program(CLOCKS_ON, asleep=number % 2 == 1))
        self.run(begin + MS)
        layouts = chance.sample(MODELLED, chance.randrange(1, 4))
        places = [
            (instance.base + register.offset, register.writable)
            for layout in layouts
            for instance in layout.instances
            for register in layout.registers
        ]
        for _ in range(40):
            address, writable = chance.choice(places)
            sparse = chance.getrandbits(32) & chance.getrandbits(32) & writable
            drawn = chance.choice((sparse, chance.getrandbits(32), 1 << chance.randrange(32), 0))
            self.machine.write(address, drawn, chance.choice((4, 4, 4, 2, 1)))
            if chance.random() < 0.2:
                self.machine.read(chance.choice(places)[0])
        list(self.machine.outbox())
        self.run_case(chance, self.machine.now_ps, chance.choice((1, 1, 5, 50)) * MS)


MODELLED = [layout for layout in LAYOUTS if layout.instances[0].base >= 0x4000_0000]
CASES: dict[str, Callable[[Fuzz, int], None]] = {"images": Fuzz.image, "registers": Fuzz.registers}


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


def main(kind: str, first: str, count: str) -> int:
    fuzz, began_s, failed = Fuzz(), time.thread_time(), 0
    for number in range(int(first), int(first) + int(count)):
        try:
            CASES[kind](fuzz, number)
        except AssertionError as error:
            failed += 1
            print(f"{kind} {number}: {error}", flush=True)
    taken = time.thread_time() - began_s
    print(f"{count} {kind} from {first}: {failed} failed, "
          f"longest run {1000 * fuzz.longest_s:.1f} ms, "
          f"{fuzz.machine.instructions} instructions, {taken:.0f} s")  # fmt: skip
    return failed > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
