"""Icarus Verilog as an engine: the same events on a top's Verilog, and what its pins settle on.

The memories are those of :mod:`cubestack.emulator.rtl.sram` once more, in Verilog: they look at the
settled pins a picosecond after each event, and what they then offer has another one to settle.
"""

import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.wiring import MEMORY_PINS, MemoryPins, Wiring

LIMIT_S = 300

_BENCH = """\
`timescale 1ps / 1ps
module bench;
{declarations}
  top dut ({ports});

{memories}
  integer events, outputs, code, n;
  reg [63:0] at, level;
  initial begin
{initial}
    for (n = 0; n < 1 << {depth}; n = n + 1) begin
{cleared}
    end
    #1;
{follow}
    events = $fopen("events.txt", "r");
    outputs = $fopen("outputs.txt", "w");
    while ($fscanf(events, "%d %d %d", at, code, level) == 3) begin
      if (at > $time) #(at - $time);
      case (code)
{cases}
      endcase
      #1;
{follow}
      #1;
      $fdisplay(outputs, "{format}", {watched});
    end
{dumps}
    $finish;
  end
endmodule
"""

_MEMORY = """\
  reg [7:0] bytes_{n}[0:(1 << {width}) - 1];
  reg [{width}-1:0] a_{n} = 0;
  reg [7:0] data_{n} = 0;
  reg writes_{n} = 0;
  reg powered_{n} = 1;
  task follow_{n};
    begin
      // A pulse ends, or its address leaves: what was there is written.
      if (powered_{n} && writes_{n} && (a_{n} != {A} || {CE_N} || {WE_N}))
        bytes_{n}[a_{n}] = data_{n};
      a_{n} = {A};
      data_{n} = {D_OE} ? {D_O} : 8'h00;
      writes_{n} = !{CE_N} && !{WE_N};
      {D_I} = !{CE_N} && !{OE_N} && {WE_N} ? bytes_{n}[a_{n}] : data_{n};
      if (!powered_{n}) {D_I} = 8'h00;
    end
  endtask
"""


class Played(NamedTuple):
    """Settled levels of the watched pins after each event, shape (events, pins); the memories.

    A level with undefined bits is -1.
    """

    outputs: NDArray[np.int64]
    memories: dict[str, bytes]


class IcarusBoard:
    """A top's Verilog between its memories, compiled once; its files are in ``folder``.

    :meth:`play` tells the ``watched`` outputs; all of them when not given. With ``edges``, inputs
    go from undefined to their first levels, which a reset of an active level needs.
    """

    def __init__(
        self,
        folder: Path,
        wiring: Wiring,
        verilog: str,
        watched: Sequence[str] = (),
        *,
        edges: bool = True,
    ) -> None:
        self._folder = folder
        self._wiring = wiring
        self._watched = watched or wiring.output_pins
        (folder / "top.v").write_text(verilog)
        (folder / "bench.v").write_text(_bench(wiring, self._watched, edges))
        command = ["iverilog", "-g2012", "-s", "bench", "-o", "bench.vvp", "bench.v", "top.v"]
        subprocess.run(command, cwd=folder, check=True, timeout=LIMIT_S)

    def play(self, events: Sequence[PinEvent]) -> Played:
        """Drive the pins; a memory's supply is the pin "power" and its name."""
        codes = {name: code for code, name in enumerate(_driven(self._wiring))}
        with (self._folder / "events.txt").open("w") as file:
            file.writelines(f"{time_ps} {codes[pin]} {level:d}\n" for time_ps, pin, level in events)
        command = ["vvp", "-n", "bench.vvp"]
        subprocess.run(command, cwd=self._folder, check=True, capture_output=True, timeout=LIMIT_S)
        text = (self._folder / "outputs.txt").read_text()
        levels = np.array(re.sub("[xXzZ]", "-1", text).split(), np.int64)
        memories = {
            memory.name: _read_hex(self._folder / f"memory_{n}.hex")
            for n, memory in enumerate(self._wiring.memories)
        }
        return Played(levels.reshape(len(events), len(self._watched)), memories)


def _driven(wiring: Wiring) -> dict[str, str]:
    supplies = {f"power {m.name}": f"powered_{n}" for n, m in enumerate(wiring.memories)}
    return {name: name for name in wiring.initial} | supplies


def _bench(wiring: Wiring, watched: Sequence[str], edges: bool) -> str:
    pins = wiring.widths
    kinds = {name: "reg" if name in wiring.initial else "wire" for name in pins}
    start = {name: f" = {level}" for name, level in wiring.initial.items() if not edges}
    numbers = range(len(wiring.memories))
    return _BENCH.format(
        declarations="".join(
            f"  {kinds[name]} [{width - 1}:0] {name}{start.get(name, '')};\n"
            for name, width in pins.items()
        ),
        ports=", ".join(f".{name}({name})" for name in pins),
        memories="\n".join(_memory(n, memory, pins) for n, memory in enumerate(wiring.memories)),
        initial="\n".join(f"    {name} = {level};" for name, level in wiring.initial.items()),
        depth=pins[wiring.memories[0]["A"]],
        cleared="\n".join(f"      bytes_{n}[n] = 0;" for n in numbers),
        follow="\n".join(f"    follow_{n};" for n in numbers),
        cases="\n".join(
            f"        {code}: {name} = level;" for code, name in enumerate(_driven(wiring).values())
        ),
        format=" ".join(["%0d"] * len(watched)),
        watched=", ".join(watched),
        dumps="\n".join(f'    $writememh("memory_{n}.hex", bytes_{n});' for n in numbers),
    )


def _memory(number: int, memory: MemoryPins, widths: Mapping[str, int]) -> str:
    pins = {pin: memory[pin] for pin in MEMORY_PINS}
    return _MEMORY.format(n=number, width=widths[memory["A"]], **pins)


def _read_hex(path: Path) -> bytes:
    lines = (re.sub(r"//.*", "", line) for line in path.read_text().splitlines())
    return bytes.fromhex("".join(lines))
