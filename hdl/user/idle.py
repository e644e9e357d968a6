"""Proves in which states of its other pins a camera's pins have no effect on a user's design.

Two copies of the design start in the same state, any state, with the same levels of all pins but
those of one camera. If they stay in the same state, with the same outputs, an engine may skip that
camera's clocks. Yosys converts all clocks and asynchronous resets into steps of one time and its
SAT solver searches for a counterexample.
"""

import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, NamedTuple

from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import ToolError, yosys_files
from cubestack.hdl.user.netlist import Bit, Netlist
from cubestack.hdl.user.nets import name_nets, registers_of
from cubestack.hdl.user.rtlil import write_rtlil

#: Time-out of a proof in seconds.
LIMIT = 60

Cube = Mapping[str, int]
"""Levels of some pins of one bit."""

FLATTEN = """
read_rtlil design.il
hierarchy -top top
proc
flatten
delete t:$scopeinfo
opt_clean
memory_collect
write_json flat.json
"""

_PROVE = """
read_rtlil flat.il
read_verilog -formal -icells harness.v
hierarchy -top harness
proc
flatten
chformal -lower
clk2fflogic
opt_expr
opt_clean
tee -o sat.txt sat -seq 3 -prove-skip 2 -prove-asserts -show before,after -timeout {limit}
"""

_STEP = re.compile(r"^ +(?:\d+|init) \\(before|after) .* ([01x-]+)$", re.MULTILINE)


class IdleVerdict(NamedTuple):
    """Whether a camera's clocks may be skipped; ``moves``: what its pins change otherwise."""

    proved: bool
    moves: str


def cubes_without(
    camera: str, storing: Callable[[Callable[[str], int]], Collection[str]]
) -> list[Cube]:
    """The levels of pins for which ``storing`` does not name ``camera``."""
    found: list[Cube] = []

    def explore(known: dict[str, int]) -> None:
        class NeededError(Exception):
            pass

        def level(name: str) -> int:
            if name not in known:
                raise NeededError(name)
            return known[name]

        try:
            idle = camera not in storing(level)
        except NeededError as error:
            for value in (0, 1):
                explore({**known, str(error): value})
            return
        if idle:
            found.append(dict(known))

    explore({})
    return found


def prove_idle(
    component: PinnedComponent,
    camera_pins: Iterable[str],
    cubes: Iterable[Cube],
    data_outputs: Mapping[str, str],
) -> IdleVerdict:
    """Try to prove that ``camera_pins`` have no effect while the other pins are in ``cubes``.

    ``data_outputs`` are outputs whose level has no effect while another output, the enable, is 0.
    Raises ToolMissingError without a Yosys.
    """
    _, text = yosys_files(FLATTEN, {"design.il": rtlil_text(component)}, "flat.json")
    netlist = Netlist(json.loads(text)["modules"]["top"])
    names, reads = _expose(netlist)
    harness = _harness(component, netlist, [*camera_pins], cubes, data_outputs, reads)
    name_nets(netlist)
    flat = re.sub(r"^  attribute \\init .*\n", "", write_rtlil(netlist), flags=re.MULTILINE)
    files = {"flat.il": flat, "harness.v": harness}
    try:
        _, report = yosys_files(_PROVE.format(limit=LIMIT), files, "sat.txt")
    except ToolError as error:
        return IdleVerdict(False, f"the proof ended with an error ({error})")
    if "proof finished - no model found: SUCCESS" in report:
        return IdleVerdict(True, "")
    levels = dict(_STEP.findall(report))
    if "proof finished - model found: FAIL" not in report or len(levels) < 2:
        return IdleVerdict(False, f"no proof within {LIMIT} s")
    return IdleVerdict(False, _first_difference(names, levels["before"], levels["after"]))


def _expose(netlist: Netlist) -> tuple[list[str], int]:
    """Add output STATE_ with all registers; memories become inputs READ_ and outputs WRITES_.

    Returns the name of each bit of STATE_, and the width of READ_.
    """
    state: list[Bit] = []
    names: list[str] = []
    for name, bits in registers_of(netlist):
        state += bits
        names += [name] * len(bits)
    reads: list[Bit] = []
    for name, cell in [*netlist.cells.items()]:
        if cell["type"] == "$mem_v2":
            del netlist.cells[name]
            pins = cell["connections"]
            reads += pins["RD_DATA"]
            # A write has an effect only with its clock's edge; the levels must agree at all times.
            for port in ("WR_CLK", "WR_EN"):
                for bit in pins[port]:
                    if isinstance(bit, int):
                        state.append(bit)
                        names.append(name)
    ports: dict[str, Any] = netlist.ports
    ports["STATE_"] = {"direction": "output", "bits": state}
    if reads:
        ports["READ_"] = {"direction": "input", "bits": reads}
    return names, len(reads)


def _harness(
    component: PinnedComponent,
    netlist: Netlist,
    camera: list[str],
    cubes: Iterable[Cube],
    data_outputs: Mapping[str, str],
    reads: int,
) -> str:
    """Verilog of two copies of the design and the assertion."""
    ports = {port.name: port for pin in component.pins for port in pin.ports}
    inputs = [f"input [{reads - 1}:0] {side}_READ_" for side in "ab" if reads]
    wires, shown = [], list[str]()
    connections: dict[str, list[str]] = {"a": [], "b": []}
    for name, port in ports.items():
        size = f"[{port.width - 1}:0]"
        if not port.output and name not in camera:
            inputs.append(f"input {size} {name}")
        for side, connected in connections.items():
            own = name if not port.output and name not in camera else f"{side}_{name}"
            connected.append(f".{name}({own})")
            if port.output:
                wires.append(f"wire {size} {own};")
            elif name in camera:
                inputs.append(f"input {size} {own}")
        if port.output:
            enable = data_outputs.get(name)
            shown.append(f"{{{port.width}{{~(X_{enable})}}}} | X_{name}" if enable else f"X_{name}")
    width = len(netlist.ports["STATE_"]["bits"])
    for side, connected in connections.items():
        wires.append(f"wire [{max(width, 1) - 1}:0] {side}_STATE_;")
        connected.append(f".STATE_({side}_STATE_)" if width else "")
        connected += [f".READ_({side}_READ_)"] if reads else []
    sides = [
        f"{{{', '.join([part.replace('X_', f'{side}_') for part in shown] + [f'{side}_STATE_'])}}}"
        for side in "ab"
    ]
    total = sum(port.width for port in ports.values() if port.output) + width
    levels = [
        " & ".join(
            f"{'' if level else '~'}{'a_' * ports[name].output}{name}"
            for name, level in cube.items()
        )
        or "1'b1"
        for cube in cubes
    ]
    idle = " | ".join(f"({text})" for text in levels) or "1'b0"
    return f"""
module harness({", ".join(inputs)});
  {" ".join(wires)}
  top a({", ".join(c for c in connections["a"] if c)});
  top b({", ".join(c for c in connections["b"] if c)});
  wire idle = {idle};
  wire [{total - 1}:0] before = {sides[0]};
  wire [{total - 1}:0] after = {sides[1]};
  wire same = before == after;
  wire idle_1, idle_2, same_1;
  \\$ff #(.WIDTH(1)) f1(.D(idle), .Q(idle_1));
  \\$ff #(.WIDTH(1)) f2(.D(idle_1), .Q(idle_2));
  \\$ff #(.WIDTH(1)) f3(.D(same), .Q(same_1));
  always @* assert(~(idle & idle_1 & idle_2 & same_1) | same);
endmodule
"""


def _first_difference(names: list[str], before: str, after: str) -> str:
    """What differs in the last step: a register, else an output."""
    width = min(len(before), len(after))
    different = [n for n in range(width) if before[-1 - n] != after[-1 - n]]
    for place in different:
        if place < len(names):
            return f"register {names[place]}"
    return "an output"
