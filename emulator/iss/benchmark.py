"""Measures the speed of the simulator, by itself and beside unicorn where that is installed.

``python -m cubestack.emulator.iss.benchmark`` prints a table of the loads.
"""

import importlib.util
import math
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from cubestack.emulator.iss import loads
from cubestack.emulator.iss.image import Image, load_image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import FLASH_BYTES, NEVER, RAM_BASE, RAM_BYTES, Machine
from cubestack.emulator.iss.outcome import StopReason

# Arithmetic, a condition and a branch, as a compiler emits them for the inner loop of a hash:
#   loop: eor r4, r0, r3; add r2, r4; add r3, r3, r3, lsl #2; add r3, r1; eor r1, r1, r2, lsr #3
#         tst r1, #1; add r0, r0, #1; it ne; subne r2, #7; b loop
_LOOP = "80ea0304 2244 03eb8303 0b44 81ead201 11f0010f 00f10100 18bf 073a f0e7"
_STACK = "00000120"
_START = "09000000"

ROUNDS = 5
"""Number of measurements; the best one counts, since other load only slows it down."""

_SLICE_PS = 2_000_000_000_000


def instructions_per_s() -> float:
    """Instructions per second of an arithmetic loop, on the part with flash waits and cache."""
    machine = Machine()
    machine.load(Image(((0, bytes.fromhex(_STACK + _START + _LOOP)),)))
    machine.reset()
    best = 0.0
    for _ in range(ROUNDS):
        before, started = machine.instructions, time.perf_counter()
        until = machine.now_ps + _SLICE_PS
        while machine.now_ps < until:
            machine.run(until)
            list(machine.outbox())
        best = max(best, (machine.instructions - before) / (time.perf_counter() - started))
    return best


class Pair(NamedTuple):
    """One load on the simulator and on unicorn: the best processor times of ``ROUNDS``."""

    name: str
    instructions: int
    plain_s: float  #: without wait states, as unicorn's memory
    waits_s: float  #: on the part as it starts: flash with a wait state and its cache
    unicorn_s: float

    @property
    def ratio(self) -> float:
        return self.unicorn_s / self.plain_s

    @property
    def waits_ratio(self) -> float:
        return self.unicorn_s / self.waits_s


def unicorn_is_here() -> bool:
    """Whether the loads can be compiled and compared."""
    return importlib.util.find_spec("unicorn") is not None and loads.COMPILER is not None


def pairs(optimization: str = "-O2") -> Iterator[Pair]:
    """Run each load in turn on both. RuntimeError if their results differ."""
    with tempfile.TemporaryDirectory() as folder:
        for name, rounds in loads.ROUNDS.items():
            elf = loads.build(name, Path(folder), rounds, optimization)
            image, end = load_image(elf), Symbols(elf.read_bytes()).labels["finished"]
            times: list[tuple[float, float, float]] = []
            for _ in range(ROUNDS):
                plain, waits = Machine(bare_hz=1_000_000), Machine()
                took = run_load(plain, image, end), run_load(waits, image, end)
                theirs_s, sum_there = _run_on_unicorn(image, end)
                times.append((*took, theirs_s))
                sums = {plain.register("r0"), waits.register("r0"), sum_there}
                if len(sums) != 1:
                    raise RuntimeError(f"{name}: sums {sorted(sums)} differ; they must be equal")
            yield Pair(name, plain.instructions, *map(min, zip(*times, strict=True)))


def run_load(machine: Machine, image: Image, end: int) -> float:
    """Run a load to its end; returns the processor time in seconds. Its sum is in r0."""
    machine.load(image)
    machine.reset()
    machine.breakpoints.add(end)
    began_s = time.process_time()
    while machine.run(NEVER).reason is not StopReason.BREAKPOINT:
        list(machine.outbox())
    return time.process_time() - began_s


def _run_on_unicorn(image: Image, end: int) -> tuple[float, int]:
    unicorn: Any = import_module("unicorn")  # an oracle of the benchmark's reader, without types
    arm_const: Any = import_module("unicorn.arm_const")

    memory = bytearray(FLASH_BYTES)
    for address, data in image.segments:
        memory[address : address + len(data)] = data
    oracle = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
    oracle.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M3)
    oracle.mem_map(0, FLASH_BYTES)
    oracle.mem_map(RAM_BASE, RAM_BYTES)
    oracle.mem_write(0, bytes(memory))
    oracle.reg_write(arm_const.UC_ARM_REG_SP, int.from_bytes(memory[:4], "little"))
    began_s = time.process_time()
    oracle.emu_start(int.from_bytes(memory[4:8], "little") | 1, end)
    taken_s = time.process_time() - began_s
    return taken_s, int(oracle.reg_read(arm_const.UC_ARM_REG_R0))


def unicorn_ratios() -> dict[str, float]:
    """Geometric means over the loads of unicorn's time by ours; empty if it cannot be measured."""
    if not unicorn_is_here():
        return {}
    found = list(pairs())
    return {
        "unicorn_ratio": _mean([pair.ratio for pair in found]),
        "unicorn_ratio_waits": _mean([pair.waits_ratio for pair in found]),
    }


def _mean(ratios: list[float]) -> float:
    return round(math.exp(sum(map(math.log, ratios)) / len(ratios)), 2)


def main() -> int:
    if not unicorn_is_here():
        print("needs unicorn and arm-none-eabi-gcc", file=sys.stderr)
        return 1
    print("| load | option | million instructions | ratio without wait states | with them |")
    print("|---|---|---|---|---|")
    for optimization in ("-O2", "-Os"):
        for one in pairs(optimization):
            figures = f"{one.instructions / 1e6:.0f} | {one.ratio:.2f} | {one.waits_ratio:.2f}"
            print(f"| {one.name} | `{optimization}` | {figures} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
