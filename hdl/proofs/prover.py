"""Runs proofs: the design as shipped, a harness around it, temporal induction.

Yosys converts all clocks and asynchronous resets into steps of one time (its ``clk2fflogic``), so
clocks may come in any order, and its SAT solver proves every assertion: true in the first steps,
and true in the next one whenever it was true in the steps before.

Registers start with any value, as in the part. For a design with a planted fault the proof must
find a counterexample from the start, which needs a small image.
"""

import json
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, NamedTuple

from amaranth.hdl import Module, Signal, Value
from amaranth.lib.wiring import Component

from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.proofs import counterexample, model
from cubestack.hdl.proofs.counterexample import Counterexample
from cubestack.hdl.proofs.model import Register, UnknownWireError

#: Largest number of steps of an induction; a property that needs more is not proved.
STEPS = 4

#: Largest number of steps of a counterexample; a clock takes two.
FAULT_STEPS = 40

#: Time-out of a proof in seconds.
LIMIT = 120


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


class ProofResult(NamedTuple):
    """Outcome of a proof and its number of steps; ``counterexample``: it is refuted."""

    proved: bool
    counterexample: bool
    steps: int
    seconds: float
    shown: Counterexample | None = None  #: how it is refuted

    def json(self) -> dict[str, object]:
        violated = self.shown.violated if self.shown else ()
        return {**self._asdict(), "shown": None, "violated": violated}


def prove(proof: Proof, planted: bool = False) -> ProofResult:
    """Try a proof, or refute it with its fault planted.

    Raises ToolMissingError without a Yosys, and UnknownWireError if the design lacks a wire.
    """
    start = time.monotonic()
    design, size = proof.make(planted)
    flat = model.flattened(rtlil_text(design, "design"))
    widths = model.widths(flat)
    names = {model.plain(name): name for name in widths}

    def found(wire: str) -> str:
        if wire not in names:
            raise UnknownWireError(f"the design has no wire {wire}")
        return names[wire]

    wires = {alias: found(wire) for alias, wire in proof.wires.items()}
    resets = {found(name): value for name, value in model.registers(flat).items()}
    exposed = {name: widths[name] for name in sorted({*wires.values(), *resets})}

    def assertions(m: Module, signals: dict[str, Value], inside: dict[str, Signal]) -> None:
        registers = [Register(model.plain(w), inside[w], reset) for w, reset in resets.items()]
        named = signals | {alias: inside[wire] for alias, wire in wires.items()}
        proof.harness(m, SimpleNamespace(**named, size=size, registers=registers))

    harness = rtlil_text(model.Harness(design, exposed, assertions), "harness")
    if planted:
        name = found(proof.fault.wire)
        flat = model.stuck(flat, name, widths[name], proof.fault.level)
    report = model.sat(flat, harness, exposed, FAULT_STEPS if planted else STEPS, LIMIT)
    shown = None
    if "model found for base case: FAIL!" in report:
        claims = [text or proof.property for text in model.claims_of(harness)]
        inside = {f"wire_{number}": model.plain(wire) for number, wire in enumerate(exposed)}
        shown = counterexample.read(report, claims, model.pins_in_harness(design), inside)
    return ProofResult(
        "Induction step proven: SUCCESS!" in report,
        shown is not None,
        len(re.findall(r"^\[base case \d+\]", report, re.MULTILINE)),
        time.monotonic() - start,
        shown,
    )


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
    planted_bug = f"planted bug ({fault.wire} stuck at {fault.level}) {found}"
    return "\n".join([f"{name}: {proof.property}", f"  {outcome}; {planted_bug}; {seconds}"])


def counterexample_text(shown: Counterexample) -> Iterator[str]:
    """The violated assertions and the table of pins, indented."""
    yield from (f"  violated: {text}" for text in shown.violated)
    yield from (f"    {line}" for line in counterexample.table(shown))


def verdict_json(done: Iterable[ProofVerdict]) -> str:
    return json.dumps(
        {
            verdict.name: {
                "property": verdict.proof.property,
                "good": verdict.good,
                "proof": verdict.result.json(),
                "fault": verdict.proof.fault._asdict(),
                "planted": verdict.planted.json(),
            }
            for verdict in done
        },
        indent=1,
    )
