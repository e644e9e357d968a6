"""Runs proofs: the design as shipped, a harness around it, temporal induction.

The design is flattened; its ports, and the internal wires that the harness names, become signals of
the harness. Yosys converts all clocks and asynchronous resets into steps of one time (its
``clk2fflogic``), so clocks may come in any order, and its SAT solver proves every assertion: true
in the first steps, and true in the next one whenever it was true in the steps before.

Registers start with any value, as in the part. For a design with a planted fault the proof must
find a counterexample from the start, which needs a small image.
"""

import json
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

from amaranth.hdl import Instance, Module, Signal, Value
from amaranth.lib.wiring import Component, In

from cubestack.hdl.flow.generate import rtlil_text
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
chformal -lower
clk2fflogic
opt -full
tee -o sat.txt sat -prove-asserts -set-assumes -tempinduct -maxsteps {steps} -timeout {limit}
"""

#: Largest number of steps of an induction; a property that needs more is not proved.
STEPS = 4

#: Largest number of steps of a counterexample; a clock takes two.
FAULT_STEPS = 40

#: Time-out of a proof in seconds.
LIMIT = 120

_CELL = re.compile(r"^  cell (\$\w+) \S+\n(.*?)^  end$", re.MULTILINE | re.DOTALL)
_WIRE = re.compile(r"^  wire (?:width (\d+) )?(?:[a-z]+(?: \d+)? )*\\(\S+)$", re.MULTILINE)


class UnknownWireError(ValueError):
    """A harness names a wire that the design does not have."""


class StuckWire(NamedTuple):
    """A planted bug: an internal wire is stuck at a level."""

    wire: str
    level: int


@dataclass(frozen=True)
class Proof:
    """A property of a design, and how it is proved."""

    property: str  #: the property, in one sentence
    #: creates the design and returns it with a description of its size; of a small image if its
    #: argument is True
    make: Callable[[bool], tuple[Component, Any]]
    #: adds assumptions and assertions to the module; the namespace has a signal for each port and
    #: each wire. Input ports are free. ``size`` is the one from ``make``, and ``registers`` are all
    #: of the design's.
    harness: Callable[[Module, SimpleNamespace], None]
    fault: StuckWire  #: a bug with which the proof must fail
    #: internal wires of the design that ``harness`` uses, by its names for them. Submodules are
    #: named as in the design, without the numbers that make names unique.
    wires: Mapping[str, str] = field(default_factory=dict)


#: Fills a harness from its module and the signals of ports and exposed wires, by name.
_Assertions = Callable[[Module, dict[str, Value], dict[str, Signal]], None]


class Register(NamedTuple):
    """A register of the design; ``reset`` is None if it has none."""

    name: str
    value: Signal
    reset: int | None


class ProofResult(NamedTuple):
    """Outcome of a proof and its number of steps; ``counterexample``: it is refuted."""

    proved: bool
    counterexample: bool
    steps: int
    seconds: float


def prove(proof: Proof, planted: bool = False) -> ProofResult:
    """Try a proof, or refute it with its fault planted.

    Raises ToolMissingError without a Yosys, and UnknownWireError if the design lacks a wire.
    """
    start = time.monotonic()
    design, size = proof.make(planted)
    flat = _flattened(rtlil_text(design, "design"))
    widths = {name: int(width or 1) for width, name in _WIRE.findall(flat)}
    names = {_plain(name): name for name in widths}

    def found(wire: str) -> str:
        if wire not in names:
            raise UnknownWireError(f"the design has no wire {wire}")
        return names[wire]

    wires = {alias: found(wire) for alias, wire in proof.wires.items()}
    resets = {found(name): value for name, value in _registers(flat).items()}
    exposed = {name: widths[name] for name in sorted({*wires.values(), *resets})}

    def assertions(m: Module, signals: dict[str, Value], inside: dict[str, Signal]) -> None:
        registers = [Register(_plain(w), inside[w], reset) for w, reset in resets.items()]
        named = signals | {alias: inside[wire] for alias, wire in wires.items()}
        proof.harness(m, SimpleNamespace(**named, size=size, registers=registers))

    harness = _Harness(design, exposed, assertions)
    text = rtlil_text(harness, "harness").replace("cell \\$ff ", "cell $ff ")
    if planted:
        name = found(proof.fault.wire)
        flat = _stuck(flat, name, widths[name], proof.fault.level)
    script = _PROVE.format(
        expose="\n".join(f"expose design/w:{name}" for name in exposed),
        steps=FAULT_STEPS if planted else STEPS,
        limit=LIMIT,
    )
    _, report = yosys_files(script, {"flat.il": flat, "harness.il": text}, "sat.txt")
    return ProofResult(
        "Induction step proven: SUCCESS!" in report,
        "model found for base case: FAIL!" in report,
        len(re.findall(r"^\[base case \d+\]", report, re.MULTILINE)),
        time.monotonic() - start,
    )


def past(m: Module, value: Value) -> Signal:
    """``value`` one step ago; unconstrained at the first step."""
    before = Signal(len(value))
    m.submodules += Instance("$ff", p_WIDTH=len(value), i_D=value, o_Q=before)
    return before


@cache
def _flattened(rtlil: str) -> str:
    return yosys_files(_FLATTEN, {"design.il": rtlil}, "flat.il")[1]


def _registers(flat: str) -> dict[str, int | None]:
    """Reset values of a flat design's registers, by plain name."""
    found: dict[str, int | None] = {}
    for kind, body in _CELL.findall(flat):
        if "dff" not in kind:
            continue
        (name,) = re.findall(r"connect \\Q \\(\S+)\n", body)
        reset = re.findall(r"parameter \\ARST_VALUE \d+'([01]+)\n", body)
        found[_plain(name)] = int(reset[0], 2) if reset else None
    return found


def _plain(wire: str) -> str:
    """A wire's name without the numbers that make submodules' names unique."""
    return re.sub(r"\$\d+(?=\.)", "", wire)


def _stuck(flat: str, wire: str, width: int, level: int) -> str:
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


class _Harness(Component):
    """The design's inputs as ports, its outputs and the ``exposed`` wires as signals."""

    def __init__(self, design: Component, exposed: dict[str, int], assertions: _Assertions) -> None:
        self._design, self._exposed, self._assertions = design, exposed, assertions
        super().__init__({name: m for name, m in design.signature.members.items() if m.flow is In})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        ports: dict[str, Value] = {}
        signals: dict[str, Value] = {}
        for name, member in self._design.signature.members.items():
            if member.flow is In:
                signals[name] = ports[f"i_{name}"] = getattr(self, name)
            else:
                signals[name] = ports[f"o_{name}"] = Signal(member.shape, name=f"design_{name}")
        inside = {}
        for number, (wire, width) in enumerate(self._exposed.items()):
            inside[wire] = ports[f"o_{wire}"] = Signal(width, name=f"wire_{number}")
        m.submodules.design = Instance("design", **ports)
        self._assertions(m, signals, inside)
        return m


class ProofVerdict(NamedTuple):
    """Outcome of a proof, and of the same with a fault planted."""

    name: str
    proof: Proof
    result: ProofResult
    planted: ProofResult

    @property
    def good(self) -> bool:
        """True if the property is proved and the planted fault refutes it."""
        return self.result.proved and self.planted.counterexample


def verdicts(proofs: Mapping[str, Proof]) -> Iterator[ProofVerdict]:
    for name, proof in proofs.items():
        yield ProofVerdict(name, proof, prove(proof), prove(proof, planted=True))


def verdict_text(verdict: ProofVerdict) -> str:
    name, proof, result, planted = verdict
    seconds = f"{result.seconds + planted.seconds:.1f} s"
    outcome = f"proved, induction over {result.steps}" if result.proved else "NOT PROVED"
    if result.counterexample:
        outcome = f"REFUTED after {result.steps} steps"
    found = f"found after {planted.steps} steps" if planted.counterexample else "NOT FOUND"
    fault = proof.fault
    return (
        f"{name}: {proof.property}\n"
        f"  {outcome}; planted bug ({fault.wire} stuck at {fault.level}) {found}; {seconds}"
    )


def verdict_json(done: Iterable[ProofVerdict]) -> str:
    return json.dumps(
        {
            verdict.name: {
                "property": verdict.proof.property,
                "good": verdict.good,
                "proof": verdict.result._asdict(),
                "fault": verdict.proof.fault._asdict(),
                "planted": verdict.planted._asdict(),
            }
            for verdict in done
        },
        indent=1,
    )
