"""Writes a capture and the emulated outputs as one VCD file that `cubestack hdl wave` shows."""

from collections.abc import Iterator
from typing import NamedTuple, TextIO

import numpy as np

from cubestack.emulator.rtl.capture.board import ComparedCapture
from cubestack.emulator.rtl.capture.replay import Levels

PREFIX = "EMU_"
"""Of the emulated outputs."""


class _Variable(NamedTuple):
    name: str
    width: int
    times: Levels
    levels: Levels
    known: Levels


def write_vcd(compared: ComparedCapture, stream: TextIO) -> None:
    """Write PIN as captured, EMU_PIN as emulated (x: not compared), and DIFFERS; times in ps."""
    variables = list(_variables(compared))
    times = np.concatenate([variable.times for variable in variables])
    start = int(times.min())
    numbers = np.concatenate([np.full(len(v.times), n) for n, v in enumerate(variables)])
    levels = np.concatenate([variable.levels for variable in variables])
    known = np.concatenate([variable.known for variable in variables])
    order = np.lexsort((numbers, times))
    codes = [f"v{number}" for number in range(len(variables))]
    head = ["$timescale 1 ps $end", "$scope module compare $end"]
    head += [
        f"$var wire {v.width} {code} {v.name} $end"
        for v, code in zip(variables, codes, strict=True)
    ]
    head += ["$upscope $end", "$enddefinitions $end"]
    stream.write("\n".join(head) + "\n")
    now = -1
    rows = (array[order].tolist() for array in (times - start, numbers, levels, known))
    for time, number, level, bits in zip(*rows, strict=True):
        if time != now:
            stream.write(f"#{time}\n")
            now = time
        width, code = variables[number].width, codes[number]
        if width == 1:
            stream.write(f"{level & 1 if bits & 1 else 'x'}{code}\n")
        else:
            stream.write(f"b{_binary(level, bits, width)} {code}\n")
    stream.write(f"#{max(now, compared.capture.end_ps - start)}\n")


def _variables(compared: ComparedCapture) -> Iterator[_Variable]:
    for name, signal in compared.captured.items():
        width = max(int(signal.bits).bit_length(), 1)
        yield _Variable(name, width, signal.times, signal.levels, signal.known)
        if name in compared.outputs:
            levels, known = compared.outputs[name]
            moved = (np.diff(levels, prepend=~levels[:1]) | np.diff(known, prepend=~known[:1])) != 0
            own = (array[moved] for array in (compared.emulated.times, levels, known))
            yield _Variable(f"{PREFIX}{name}", width, *own)
    differences = compared.comparison.differences
    moments = np.array([t for d in differences for t in (d.time_ps, d.end_ps)], np.int64)
    steps = np.tile([1, -1], len(differences))
    times, inverse = np.unique(moments, return_inverse=True)
    change = np.bincount(inverse, steps, len(times)).astype(np.int64)
    open_ones = np.concatenate([[0], np.cumsum(change)]) > 0
    first = compared.capture.times[:1]
    yield _Variable(
        "DIFFERS",
        1,
        np.concatenate([first, times]),
        open_ones.astype(np.int64),
        np.ones(len(times) + 1, np.int64),
    )


def _binary(level: int, known: int, width: int) -> str:
    if known == (1 << width) - 1:
        return f"{level & known:b}"
    return "".join(
        str(level >> bit & 1) if known >> bit & 1 else "x" for bit in reversed(range(width))
    )
