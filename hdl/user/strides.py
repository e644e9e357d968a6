"""Strides of a user's design: those of the shipped one, where its proofs hold for the user's too.

The registers are found by the ends of their paths: ``core.reader.counter.column`` may be the
shipped design's ``reader.counter.column``. Nothing depends on that guess, as only what is proved
of the found registers is used.
"""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from types import SimpleNamespace
from typing import Any

from amaranth.hdl import Instance, Module, Signal, Value
from amaranth.lib.wiring import Component, In

from cubestack.hdl.blocks.pinned import PinnedComponent, Stride
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import ToolError, yosys_files
from cubestack.hdl.proofs.model import Register
from cubestack.hdl.proofs.prover import STEPS
from cubestack.hdl.proofs.strides import each_clock
from cubestack.hdl.user.copies import FLATTEN
from cubestack.hdl.user.idle import LIMIT
from cubestack.hdl.user.netlist import Netlist
from cubestack.hdl.user.nets import name_nets, registers_of
from cubestack.hdl.user.rtlil import write_rtlil

_PROVE = """
read_rtlil flat.il
read_rtlil harness.il
hierarchy -top harness
proc
flatten
chformal -lower
clk2fflogic
opt -full
tee -o sat.txt sat -prove-asserts -set-assumes -tempinduct -maxsteps {steps} -timeout {limit}
"""


def proved_strides(component: PinnedComponent, shipped: PinnedComponent) -> list[Stride]:
    """The strides of ``shipped`` that ``component`` has too; ToolMissingError without a Yosys."""
    if not shipped.strides:
        return []
    _, text = yosys_files(FLATTEN, {"design.il": rtlil_text(component)}, "flat.json")
    content = text
    registers = [name for name, _ in registers_of(_netlist(content))]
    if any(cell["type"].startswith("$mem") for cell in _netlist(content).cells.values()):
        return []
    candidates = (_renamed(stride, registers) for stride in shipped.strides)
    return [one for one in candidates if one is not None and _prove(component, one, content)]


def stride_of(fields: Mapping[str, Any]) -> Stride:
    """The stride with these fields, as JSON has them."""
    levels = {key: tuple(tuple(one) for one in fields[key]) for key in ("levels", "state")}
    return Stride(**{**fields, **levels})


def stride_fields(stride: Stride) -> dict[str, Any]:
    return asdict(stride)


def _netlist(text: str) -> Netlist:
    return Netlist(json.loads(text)["modules"]["top"])


def _renamed(stride: Stride, registers: list[str]) -> Stride | None:
    """The stride with the user's names of its registers; None if one has no counterpart."""

    def found(path: str) -> str:
        matching = [name for name in registers if f".{name}".endswith(f".{path}")]
        if len(matching) != 1:
            raise LookupError(path)
        return matching[0]

    try:
        return replace(
            stride,
            counter=found(stride.counter) if stride.counter else "",
            data=found(stride.data),
            state=tuple((found(path), level) for path, level in stride.state),
        )
    except LookupError:
        return None


def _prove(component: PinnedComponent, stride: Stride, text: str) -> bool:
    netlist = _netlist(text)
    found = [*registers_of(netlist)]
    for number, (_, bits) in enumerate(found):
        netlist.ports[f"REGISTER_{number}"] = {"direction": "output", "bits": bits}
    name_nets(netlist)
    flat = re.sub(r"^  attribute \\init .*\n", "", write_rtlil(netlist), flags=re.MULTILINE)
    flat = flat.replace("module \\top\n", "module \\design\n", 1)
    widths = {name: len(bits) for name, bits in found}
    harness = rtlil_text(_Harness(component, stride, widths), "harness")
    files = {"flat.il": flat, "harness.il": harness.replace("cell \\$ff ", "cell $ff ")}
    try:
        _, report = yosys_files(_PROVE.format(steps=STEPS, limit=LIMIT), files, "sat.txt")
    except ToolError:
        return False
    return "Induction step proven: SUCCESS!" in report


class _Harness(Component):
    """The design's inputs as ports; the assertions of a stride about its outputs and registers."""

    def __init__(
        self, design: PinnedComponent, stride: Stride, registers: Mapping[str, int]
    ) -> None:
        self._members = dict(design.signature.members)
        self._stride, self._registers = stride, registers
        super().__init__({name: m for name, m in self._members.items() if m.flow is In})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        signals = dict[str, Value]()
        ports = dict[str, Value]()
        for name, member in self._members.items():
            if member.flow is In:
                signals[name] = ports[f"i_{name}"] = getattr(self, name)
            else:
                signals[name] = ports[f"o_{name}"] = Signal(member.shape, name=f"design_{name}")
        values = [*self._outputs()]
        ports |= {f"o_REGISTER_{number}": one.value for number, one in enumerate(values)}
        m.submodules.design = Instance("design", **ports)
        size = SimpleNamespace(members=self._members)
        each_clock(m, SimpleNamespace(**signals, size=size, registers=values), self._stride)
        return m

    def _outputs(self) -> Iterator[Register]:
        for number, (name, width) in enumerate(self._registers.items()):
            yield Register(name, Signal(width, name=f"register_{number}"), None)
