"""Measures the speed of the simulator."""

import time

from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import Machine

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
