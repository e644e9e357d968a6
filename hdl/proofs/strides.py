"""Proofs that a design does in each clock of a stride exactly what it declares."""

from collections.abc import Callable
from types import SimpleNamespace

from amaranth.hdl import Assert, Cat, Module, Mux, Value
from amaranth.lib.wiring import In

from cubestack.hdl.blocks.pinned import PinnedComponent, Stride
from cubestack.hdl.proofs.model import past
from cubestack.hdl.proofs.properties import first_step
from cubestack.hdl.proofs.prover import Proof, StuckWire

Make = Callable[[bool], tuple[PinnedComponent, SimpleNamespace]]


def stride_proof(make: Make, name: str, fault: StuckWire) -> Proof:
    """The proof of the stride ``name``; ``make`` and ``fault`` as in ``Proof``."""

    def stride_design(small: bool) -> tuple[PinnedComponent, SimpleNamespace]:
        design, _ = make(small)
        (stride,) = (each for each in design.strides if each.name == name)
        return design, SimpleNamespace(stride=stride, members=design.signature.members)

    return Proof(
        "Inside a row each clock takes a byte to or from the next address, and does nothing else",
        stride_design,
        each_clock,
        fault,
    )


def each_clock(m: Module, d: SimpleNamespace) -> None:
    """Assertions of the stride ``d.size.stride`` of a design with the ports ``d.size.members``."""
    stride: Stride = d.size.stride
    registers = {register.name: register.value for register in d.registers}
    counter, data = registers[stride.counter], registers[stride.data]
    inputs = {name for name, member in d.size.members.items() if member.flow is In}
    steady = inputs - {stride.clock, stride.source, f"{stride.memory}_D_I"}
    stays = Cat(getattr(d, name) == past(m, getattr(d, name)) for name in sorted(steady)).all()

    ready = Cat(
        *(getattr(d, pin) == level for pin, level in stride.levels),
        *(registers[register] == value for register, value in stride.state),
        counter < stride.last,
    ).all()
    within = past(m, ready) & stays & ~first_step()
    clock = getattr(d, stride.clock)
    rises = clock & ~past(m, clock)
    moved = {stride.counter: past(m, counter) + 1, stride.data: past(m, getattr(d, stride.source))}
    for name, value in registers.items():
        before = past(m, value)
        after = Mux(rises, moved.get(name, before), before)
        m.d.comb += Assert(
            ~within | (value == after), f"register {name} is as a clock of the stride leaves it"
        )

    _at_the_memory(m, d, stride, ready, counter, data)
    address = getattr(d, f"{stride.memory}_A")
    stays_there = address[len(counter) :] == past(m, address)[len(counter) :]
    m.d.comb += Assert(~within | stays_there, f"the high bits of {stride.memory}_A do not change")
    shown = {f"{stride.memory}_{pin}" for pin in ("A", "D_O", "WE_N")}
    if not stride.stores:
        shown.add("DATA")
        m.d.comb += Assert(~ready | (data == d.DATA), "DATA is the byte read last")
    for name in sorted({*d.size.members} - inputs - shown):
        same = getattr(d, name) == past(m, getattr(d, name))
        m.d.comb += Assert(~within | same, f"{name} does not change")


def _at_the_memory(
    m: Module, d: SimpleNamespace, stride: Stride, ready: Value, counter: Value, data: Value
) -> None:
    """Levels of the memory's pins during the stride."""
    a, d_o, d_oe, ce_n, oe_n, we_n = (
        getattr(d, f"{stride.memory}_{pin}") for pin in ("A", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")
    )
    expected = [a[: len(counter)] == counter, ~ce_n]
    if stride.stores:
        expected += [d_o == data, d_oe, oe_n, we_n == getattr(d, stride.clock)]
    else:
        expected += [~d_oe, ~oe_n, we_n]
    text = f"the pins of {stride.memory} are as the stride says"
    m.d.comb += Assert(~ready | Cat(*expected).all(), text)
