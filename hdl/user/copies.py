"""Two copies of a user's design that differ in a camera's pins only, for proofs about them."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import yosys_files
from cubestack.hdl.user.netlist import Bit, Netlist
from cubestack.hdl.user.nets import name_nets, registers_of
from cubestack.hdl.user.rtlil import write_rtlil

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


class IdleCamera(NamedTuple):
    """Pins of a camera whose clocks an engine may skip, and the controls."""

    data: str
    syncs: tuple[str, ...]  #: clock, line and frame pins: true whenever a control changes
    controls: tuple[str, ...]  #: inputs; the engine sets ``syncs`` right before it changes one


class Copies:
    """The design without initial values, and a harness around its copies "a" and "b".

    ``data_outputs`` are outputs whose level has no effect while another output, the enable, is 0.

    Attributes:
        names: the register of each bit of the states, lowest first.
    """

    def __init__(
        self, component: PinnedComponent, camera: IdleCamera, data_outputs: Mapping[str, str]
    ) -> None:
        """Raise ToolMissingError without a Yosys."""
        _, text = yosys_files(FLATTEN, {"design.il": rtlil_text(component)}, "flat.json")
        netlist = Netlist(json.loads(text)["modules"]["top"])
        self._ports = {port.name: port for pin in component.pins for port in pin.ports}
        self._camera, self._enables = camera, data_outputs
        self.names, self._reads = _expose(netlist)
        self._states = len(netlist.ports["STATE_"]["bits"])
        name_nets(netlist)
        written = write_rtlil(netlist)
        self._flat = re.sub(r"^  attribute \\init .*\n", "", written, flags=re.MULTILINE)

    def files(self, cubes: Iterable[Cube], pins: Iterable[str], claim: str) -> dict[str, str]:
        """The design "top" in flat.il and the module "harness" in harness.v.

        ``claim`` is an assertion about these wires, where ``_1`` is one step ago:

        - ``before`` and ``after``: outputs and registers of "a" and "b", registers in the low bits;
          ``same``, ``same_1``: whether they are equal;
        - ``idle``, ``idle_1``: the other pins have levels of one of ``cubes``;
        - ``calm``: no control changes, or only while both copies have the same syncs;
        - ``at_PIN``: level of each of ``pins`` in "a".
        """
        body = "\n".join([*self._copies(), *self._wires(cubes, pins), f"always @* {claim};"])
        harness = f"module harness({', '.join(self._inputs())});\n{body}\nendmodule\n"
        return {"flat.il": self._flat, "harness.v": harness}

    @property
    def _differing(self) -> tuple[str, ...]:
        return self._camera.data, *self._camera.syncs

    def _inputs(self) -> Iterator[str]:
        for name, port in self._ports.items():
            if not port.output:
                for side in "ab" if name in self._differing else " ":
                    prefix = f"{side}_" if side.strip() else ""
                    yield f"input [{port.width - 1}:0] {prefix}{name}"
        if self._reads:
            yield from (f"input [{self._reads - 1}:0] {side}_READ_" for side in "ab")

    def _copies(self) -> Iterator[str]:
        for side in "ab":
            connected = []
            for name, port in self._ports.items():
                own = port.output or name in self._differing
                connected.append(f".{name}({f'{side}_' * own}{name})")
                if port.output:
                    yield f"wire [{port.width - 1}:0] {side}_{name};"
            yield f"wire [{max(self._states, 1) - 1}:0] {side}_STATE_;"
            connected += [f".STATE_({side}_STATE_)"] if self._states else []
            connected += [f".READ_({side}_READ_)"] if self._reads else []
            yield f"top {side}({', '.join(connected)});"

    def _wires(self, cubes: Iterable[Cube], pins: Iterable[str]) -> Iterator[str]:
        outputs = [port for port in self._ports.values() if port.output]
        total = sum(port.width for port in outputs) + self._states
        for wire, side in (("before", "a"), ("after", "b")):
            parts = [self._shown(side, port.name, port.width) for port in outputs]
            parts += [f"{side}_STATE_"] if self._states else []
            yield f"wire [{total - 1}:0] {wire} = {{{', '.join(parts)}}};"
        idle = " | ".join(f"({self._within(cube)})" for cube in cubes)
        syncs = [" , ".join(f"{side}_{pin}" for pin in self._camera.syncs) for side in "ab"]
        controls = ", ".join(self._camera.controls) or "1'b0"
        yield f"wire same = before == after;\nwire idle = {idle or '0'};"
        yield f"wire alike = {{{syncs[0]}}} == {{{syncs[1]}}};"
        width = sum(self._ports[pin].width for pin in self._camera.controls) or 1
        yield f"wire [{width - 1}:0] controls = {{{controls}}};"
        for name, size in (("same", 1), ("idle", 1), ("alike", 1), ("controls", width)):
            yield f"wire [{size - 1}:0] {name}_1;"
            yield f"\\$ff #(.WIDTH({size})) was_{name}(.D({name}), .Q({name}_1));"
        yield "wire calm = (controls == controls_1) | (alike & alike_1);"
        yield from (f"wire at_{pin} = {self._of_a(pin)};" for pin in pins)

    def _shown(self, side: str, name: str, width: int) -> str:
        enable = self._enables.get(name)
        return f"({{{width}{{~{side}_{enable}}}}} | {side}_{name})" if enable else f"{side}_{name}"

    def _within(self, cube: Cube) -> str:
        levels = (f"{'' if level else '~'}{self._of_a(pin)}" for pin, level in cube.items())
        return " & ".join(levels) or "1'b1"

    def _of_a(self, pin: str) -> str:
        return f"{'a_' * self._ports[pin].output}{pin}"


def _expose(netlist: Netlist) -> tuple[list[str], int]:
    """Add output STATE_ with all registers, and input READ_ in place of memories.

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
