"""Tries to prove a contract's properties of a design, or refutes them."""

import re
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from os import cpu_count
from time import monotonic
from types import SimpleNamespace
from typing import NamedTuple

from amaranth.hdl import Const, Module, Signal, Value
from amaranth.lib.wiring import Component

from cubestack.hdl.contract.contract import Property, Size
from cubestack.hdl.contract.design import Design
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.proofs import counterexample, model
from cubestack.hdl.proofs.counterexample import Counterexample

#: Seconds that one step may take; then a property holds for the steps before.
LIMIT_S = 5


class Verdict(NamedTuple):
    """About one property; ``steps`` is how far it holds, or the length of the counterexample."""

    name: str
    requirement: str
    proved: bool  #: by induction: for any number of steps
    steps: int
    shown: Counterexample | None
    size: Size
    seconds: float

    @property
    def outcome(self) -> str:
        """In words."""
        if self.shown:
            return f"REFUTED after {self.steps} steps"
        if self.proved:
            return "proved by induction"
        clocks = self.steps // 2
        return f"holds for {clocks} clock{'s' * (clocks != 1)} from power-up (bounded proof)"


def properties_of(design: Design, text: str = "") -> dict[str, Property]:
    """Those whose name starts with ``text``; ValueError if there is none."""
    properties = design.contract.properties
    chosen = {name: one for name, one in properties.items() if name.startswith(text)}
    if not chosen:
        raise ValueError(f"{text!r} is no property; there are {', '.join(properties)}")
    return chosen


def prove_contract(design: Design, properties: Mapping[str, Property]) -> Iterator[Verdict]:
    """Verdicts in order; raises GatewareError and ToolMissingError."""
    size = design.contract.proof if design.sized else design.contract.full
    component = design.make(size)
    flat = model.flattened(rtlil_text(component, "design"))
    prove = partial(_verdict, flat=flat, component=component, size=size)
    with ThreadPoolExecutor(min(2, cpu_count() or 1)) as pool:
        yield from pool.map(prove, properties, properties.values())


def _verdict(name: str, one: Property, *, flat: str, component: Component, size: Size) -> Verdict:
    start = monotonic()
    harness = rtlil_text(model.Harness(component, {}, _assertions(one, size)), "harness")
    report = model.sat(flat, harness, (), one.steps, LIMIT_S)
    steps = len(re.findall(r"^Base case for induction length \d+ proven", report, re.MULTILINE))
    shown = None
    if "model found for base case: FAIL!" in report:
        claims = model.claims_of(harness)
        shown = counterexample.read(report, claims, model.pins_in_harness(component), {})
        steps = shown.steps
    proved = "Induction step proven: SUCCESS!" in report
    return Verdict(name, one.requirement, proved, steps, shown, size, monotonic() - start)


def _assertions(
    one: Property, size: Size
) -> Callable[[Module, dict[str, Value], dict[str, Signal]], None]:
    def add(m: Module, signals: dict[str, Value], _: dict[str, Signal]) -> None:
        one.harness(m, SimpleNamespace(**signals, size=size, NEVER=Const(0)))

    return add
