"""Proofs that a design does in each clock of a stride exactly what it declares."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from amaranth.hdl import Assert, Cat, Const, Module, Mux, Value
from amaranth.lib.wiring import In

from cubestack.hdl.blocks.pinned import PinnedComponent, Stride
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import first_step
from cubestack.hdl.proofs.prover import Proof, StuckWire

Make = Callable[[bool], tuple[PinnedComponent, Any]]


def stride_proof(make: Make, fault: StuckWire, *names: str) -> Proof:
    """The proof of the strides ``names``, by default of all.

    ``make`` and ``fault`` are as in ``Proof``.
    """

    def stride_design(small: bool) -> tuple[PinnedComponent, SimpleNamespace]:
        design, _ = make(small)
        strides = [one for one in design.strides if not names or one.name in names]
        return design, SimpleNamespace(strides=strides, members=design.signature.members)

    def harness(m: Module, d: SimpleNamespace) -> None:
        for stride in d.size.strides:
            each_clock(m, d, stride)

    return Proof(
        "Each clock of the stride takes a byte and counts, and does nothing else",
        stride_design,
        harness,
        fault,
    )


def each_clock(m: Module, d: SimpleNamespace, stride: Stride) -> None:
    """Assertions of a stride of a design with the ports ``d.size.members``."""
    registers = {register.name: register.value for register in d.registers}
    counter = registers[stride.counter] if stride.counter else Const(0)
    data = registers[stride.data]
    inputs = {name for name, member in d.size.members.items() if member.flow is In}
    steady = inputs - {stride.clock, stride.source, f"{stride.memory}_D_I"}
    stays = Cat(getattr(d, name) == past(m, getattr(d, name)) for name in sorted(steady)).all()

    ready = Cat(
        *(getattr(d, pin) == level for pin, level in stride.levels),
        *(registers[register] == value for register, value in stride.state),
        counter < max(stride.last, 1),
        data < stride.below,
    ).all()
    within = past(m, ready) & stays & ~first_step()
    clock = getattr(d, stride.clock)
    rises = clock & ~past(m, clock)
    moved = {stride.data: past(m, getattr(d, stride.source))}
    if stride.counter:
        moved[stride.counter] = past(m, counter) + 1
    for name, value in registers.items():
        before = past(m, value)
        after = Mux(rises, moved.get(name, before), before)
        m.d.comb += Assert(
            ~within | (value == after), f"in {stride.name} register {name} is as a clock leaves it"
        )

    _at_the_memory(m, d, stride, ready, counter, data)
    shown = {f"{stride.memory}_D_O"}
    if stride.access != "drop":
        shown |= {f"{stride.memory}_{pin}" for pin in ("A", "WE_N")}
        address = getattr(d, f"{stride.memory}_A")
        same = address[len(counter) :] == past(m, address)[len(counter) :]
        m.d.comb += Assert(
            ~within | same, f"in {stride.name} the high bits of {stride.memory}_A do not change"
        )
    if stride.access == "read":
        shown.add("DATA")
        m.d.comb += Assert(
            ~ready | (data == d.DATA), f"in {stride.name} DATA is the byte read last"
        )
    for name in sorted({*d.size.members} - inputs - shown):
        same = getattr(d, name) == past(m, getattr(d, name))
        m.d.comb += Assert(~within | same, f"in {stride.name} {name} does not change")


def _at_the_memory(
    m: Module, d: SimpleNamespace, stride: Stride, ready: Value, counter: Value, data: Value
) -> None:
    """Levels of the memory's pins during the stride."""
    a, d_o, d_oe, ce_n, oe_n, we_n = (
        getattr(d, f"{stride.memory}_{pin}") for pin in ("A", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")
    )
    counted = a[: len(counter)] == counter
    match stride.access:
        case "store":
            clock = getattr(d, stride.clock)
            expected = [counted, ~ce_n, d_o == data, d_oe, oe_n, we_n == clock]
        case "read":
            expected = [counted, ~ce_n, ~d_oe, ~oe_n, we_n]
        case "drop":
            expected = [~d_oe, we_n]
    text = f"in {stride.name} the pins of {stride.memory} are as it says"
    m.d.comb += Assert(~ready | Cat(*expected).all(), text)
