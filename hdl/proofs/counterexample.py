"""What a refuted proof shows: the assertion in words, the pins step by step, a waveform."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

from vcd import VCDWriter

#: Columns of a table of pins; longer ones continue below.
WIDTH = 100

#: Folder of the waveforms, which `cubestack hdl wave` looks in.
FOLDER = Path("out/hdl/proofs")

_LINE = re.compile(r"^ +(\d+) \\(\S+) .*?([01]+) *$", re.MULTILINE)


@dataclass(frozen=True)
class Counterexample:
    """Levels step by step, from any state on; a period of a clock is at least two steps."""

    violated: tuple[str, ...]  #: the sentences of the assertions that the last step violates
    pins: Mapping[str, Sequence[int]]  #: by name
    inside: Mapping[str, Sequence[int]]  #: internal wires and registers by name
    widths: Mapping[str, int]

    @property
    def steps(self) -> int:
        return max(map(len, self.pins.values()), default=0)


def read(
    report: str, claims: Sequence[str], pins: Mapping[str, str], inside: Mapping[str, str]
) -> Counterexample:
    """The counterexample in a report of Yosys' ``sat -show-public``.

    ``claims`` are the assertions' sentences, ``pins`` and ``inside`` the names by those of the
    harness.
    """
    model = report.rpartition("FAIL!")[2]
    levels: dict[str, list[int]] = {}
    widths: dict[str, int] = {}
    for _, name, bits in _LINE.findall(model):
        levels.setdefault(name, []).append(int(bits, 2))
        widths[name] = len(bits)
    violated = dict.fromkeys(
        text
        for number, text in enumerate(claims)
        if levels[f"claim_{number}"][-1] < levels[f"claim_{number}_on"][-1]
    )
    named = {**pins, **inside}
    return Counterexample(
        tuple(violated),
        {name: levels[wire] for wire, name in pins.items() if wire in levels},
        {name: levels[wire] for wire, name in inside.items() if wire in levels},
        {name: widths[wire] for wire, name in named.items() if wire in widths},
    )


def table(shown: Counterexample) -> Iterator[str]:
    """The pins by step in hexadecimal; a dot where a pin has not changed.

    Pins that never change are listed below.
    """
    moving = {name: row for name, row in shown.pins.items() if len({*row}) > 1}
    digits = {name: -(-shown.widths[name] // 4) for name in moving}
    cell = 1 + max([len(str(shown.steps)), *digits.values()])
    label = max(map(len, ["step", *moving]))
    per_line = max(1, (WIDTH - label) // cell)
    for first in range(0, shown.steps, per_line):
        steps = range(first, min(first + per_line, shown.steps))
        yield f"{'step':<{label}}" + "".join(f"{step + 1:>{cell}}" for step in steps)
        for name, row in moving.items():
            cells = (
                f"{row[step]:0{digits[name]}x}"
                if step == first or row[step] != row[step - 1]
                else "."
                for step in steps
            )
            yield f"{name:<{label}}" + "".join(f"{text:>{cell}}" for text in cells)
    still = [f"{name}={row[0]:x}" for name, row in shown.pins.items() if name not in moving]
    if still:
        yield f"unchanged: {' '.join(still)}"


def write_vcd(path: Path, name: str, shown: Counterexample) -> None:
    """Write the waveform, a step per ns, and beside it what it shows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with (
        path.open("w", encoding="utf-8") as file,
        VCDWriter(file, timescale="1 ns", init_timestamp=0) as writer,
    ):
        changes: list[tuple[int, Any, int]] = []
        for scope, group in (("dut", shown.pins), ("dut.inside", shown.inside)):
            for signal, row in group.items():
                plain = re.sub(r"[^\w.]", "_", signal)
                width = shown.widths[signal]
                variable = writer.register_var(scope, plain, "wire", size=width, init=row[0])
                changes += [
                    (step, variable, after)
                    for step, (before, after) in enumerate(pairwise(row), 1)
                    if before != after
                ]
        for step, variable, level in sorted(changes, key=itemgetter(0)):
            writer.change(variable, step, level)
        writer.close(shown.steps)
    about = {
        "test": name,
        "title": f"counterexample of {name}, a step per ns",
        "error": "; ".join(shown.violated),
    }
    path.with_suffix(".json").write_text(json.dumps(about, indent=1), encoding="utf-8")
