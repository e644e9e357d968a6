"""A design in a harness of assumptions and assertions, as texts for Yosys.

The design is flattened; its ports, and the internal wires that the harness names, become signals of
the harness.
"""

import re
from collections.abc import Callable, Iterable
from functools import cache
from itertools import count
from typing import NamedTuple

from amaranth.hdl import Instance, Module, Signal, Value
from amaranth.lib.wiring import Component, In

from cubestack.hdl.flow.tools import yosys_files

_FLATTEN = """
read_rtlil design.il
hierarchy -top design
proc
flatten
attrmap -remove init
write_rtlil flat.il
"""


_PROVE = """
read_rtlil flat.il
{expose}
read_rtlil harness.il
hierarchy -top harness
proc
flatten
memory_map
chformal -lower
clk2fflogic
opt -full
tee -o sat.txt sat -prove-asserts -set-assumes -tempinduct -show-public \
    -maxsteps {steps} -timeout {limit}
"""

_CELL = re.compile(r"^  cell (\$\w+) \S+\n(.*?)^  end$", re.MULTILINE | re.DOTALL)
_WIRE = re.compile(r"^  wire (?:width (\d+) )?(?:[a-z]+(?: \d+)? )*\\(\S+)$", re.MULTILINE)


_CHECK = re.compile(r"^  cell \$check \S+\n(.*?)^  end$", re.MULTILINE | re.DOTALL)


class UnknownWireError(ValueError):
    """A harness names a wire that the design does not have."""


def widths(flat: str) -> dict[str, int]:
    """A flat design's named wires."""
    return {name: int(width or 1) for width, name in _WIRE.findall(flat)}


def sat(flat: str, harness: str, exposed: Iterable[str], steps: int, limit: int) -> str:
    """Yosys' report about the assertions; ``limit`` in seconds per step."""
    script = _PROVE.format(
        expose="\n".join(f"expose design/w:{name}" for name in exposed), steps=steps, limit=limit
    )
    text = with_claims(harness).replace("cell \\$ff ", "cell $ff ")
    return yosys_files(script, {"flat.il": flat, "harness.il": text}, "sat.txt")[1]


def pins_in_harness(design: Component) -> dict[str, str]:
    """The design's ports by the names of their signals in the harness."""
    return {
        name if member.flow is In else f"shown_{name}": name
        for name, member in design.signature.members.items()
    }


#: Fills a harness from its module and the signals of ports and exposed wires, by name.
Assertions = Callable[[Module, dict[str, Value], dict[str, Signal]], None]


class Register(NamedTuple):
    """A register of the design; ``reset`` is None if it has none."""

    name: str
    value: Signal
    reset: int | None


def past(m: Module, value: Value) -> Signal:
    """``value`` one step ago; unconstrained at the first step."""
    before = Signal(len(value))
    m.submodules += Instance("$ff", p_WIDTH=len(value), i_D=value, o_Q=before)
    return before


@cache
def flattened(rtlil: str) -> str:
    return yosys_files(_FLATTEN, {"design.il": rtlil}, "flat.il")[1]


def registers(flat: str) -> dict[str, int | None]:
    """Reset values of a flat design's registers, by plain name."""
    found: dict[str, int | None] = {}
    for kind, body in _CELL.findall(flat):
        if "dff" not in kind:
            continue
        (name,) = re.findall(r"connect \\Q \\(\S+)\n", body)
        reset = re.findall(r"parameter \\ARST_VALUE \d+'([01]+)\n", body)
        found[plain(name)] = int(reset[0], 2) if reset else None
    return found


def plain(wire: str) -> str:
    """A wire's name without the numbers that make submodules' names unique."""
    return re.sub(r"\$\d+(?=\.)", "", wire)


def stuck(flat: str, wire: str, width: int, level: int) -> str:
    """The flat design with a wire's driver replaced by a constant."""
    name = re.escape(f"\\{wire}")
    by_cell = re.compile(rf"^(    connect \\(?:Y|Q)) {name}$", re.MULTILINE)
    by_wire = re.compile(rf"^  connect {name} .*\n", re.MULTILINE)
    text, cells = by_cell.subn(r"\1 $driver", flat)
    text, wires = by_wire.subn("", text)
    if cells + wires != 1:
        raise UnknownWireError(f"wire {wire} has {cells + wires} whole drivers, not one")
    text = text.replace("module \\design\n", f"module \\design\n  wire width {width} $driver\n")
    head, end, tail = text.rpartition("\nend\n")
    return f"{head}\n  connect \\{wire} {width}'{level:0{width}b}{end}{tail}"


def claims_of(harness: str) -> tuple[str, ...]:
    """The sentences of a harness's assertions in order; empty where one has none."""
    found = (_field(body, r"parameter \\FORMAT") for body in _CHECK.findall(harness))
    return tuple(text[1:-1].replace("{{", "{").replace("}}", "}") for text in found)


def with_claims(harness: str) -> str:
    """The harness with wires ``claim_N``, which are high while assertion N holds."""

    def shown(match: "re.Match[str]") -> str:
        number = next(numbers)
        holds, on = _field(match[1], r"connect \\A"), _field(match[1], r"connect \\EN")
        return (
            f"{match[0]}\n"
            f"  wire width 1 \\claim_{number}\n  wire width 1 \\claim_{number}_on\n"
            f"  connect \\claim_{number} {holds}\n  connect \\claim_{number}_on {on}\n"
        )

    numbers = count()
    return _CHECK.sub(shown, harness)


def _field(body: str, name: str) -> str:
    (value,) = re.findall(rf"^    {name} (.*)$", body, re.MULTILINE)
    return str(value)


class Harness(Component):
    """The design's ports as ports; its outputs and the ``exposed`` wires as signals."""

    def __init__(self, design: Component, exposed: dict[str, int], assertions: Assertions) -> None:
        self._design, self._exposed, self._assertions = design, exposed, assertions
        super().__init__(
            {
                name if member.flow is In else f"shown_{name}": member
                for name, member in design.signature.members.items()
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        ports: dict[str, Value] = {}
        signals: dict[str, Value] = {}
        for name, member in self._design.signature.members.items():
            if member.flow is In:
                signals[name] = ports[f"i_{name}"] = getattr(self, name)
            else:
                signals[name] = ports[f"o_{name}"] = Signal(member.shape, name=f"design_{name}")
                m.d.comb += getattr(self, f"shown_{name}").eq(signals[name])
        inside = {}
        for number, (wire, width) in enumerate(self._exposed.items()):
            inside[wire] = Signal(width, name=f"wire_{number}")
            if wire in signals:  # a port that is a register
                m.d.comb += inside[wire].eq(signals[wire])
            else:
                ports[f"o_{wire}"] = inside[wire]
        m.submodules.design = Instance("design", **ports)
        self._assertions(m, signals, inside)
        return m
