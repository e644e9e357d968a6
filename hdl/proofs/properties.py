"""Properties that several designs share, as assumptions and assertions in a harness."""

from collections.abc import Collection, Iterable
from types import SimpleNamespace
from typing import Any

from amaranth import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Signal, Value
from amaranth.hdl import Assert, Assume
from amaranth.hdl._ast import Initial  # not among the public names, though documented as one

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.proofs.model import past

#: What :func:`acknowledges` asserts.
ACKNOWLEDGES = "ACK is high exactly from when all rows of a frame are stored"

#: The sentence of an assertion that the induction needs.
AUXILIARY = "a statement about internal registers, which the induction needs"

#: Wires of a writer and their paths below it.
WRITER_WIRES = {
    "rst": "{domain}_rst",
    **{name: f"counter.{name}" for name in ("column", "row")},
    **{n: n for n in ("vsync", "store", "ack", "line_open", "line_full", "frame_full")},
}


def wires_below(part: str, *names: str) -> dict[str, str]:
    return {name: f"{part}.{name}" for name in names}


def writer_wires(writer: str, domain: str, below: str | None = None) -> dict[str, str]:
    """Wires of a writer, prefixed with its name; ``below`` is its submodule if it differs."""
    return {
        f"{writer}_{name}": f"{below or writer}.{wire.format(domain=domain)}"
        for name, wire in WRITER_WIRES.items()
    }


def first_step() -> Value:
    return Initial()


def domain(m: Module, name: str, clock: Value, reset: Value) -> Any:
    """Statements at the rising edge of ``clock``, with an asynchronous reset."""
    m.domains += ClockDomain(name, async_reset=True, local=True)
    m.d.comb += [ClockSignal(name).eq(clock), ResetSignal(name).eq(reset)]
    return m.d[name]


def starts_in(m: Module, standby: Value) -> None:
    """Assume that the first step is in standby, which defines the state."""
    m.d.comb += Assume(standby | ~Initial())


def idle_is_reset(m: Module, d: SimpleNamespace, standby: Value, retained: set[str]) -> None:
    """In standby each register has its reset value, except the ``retained`` ones, which are stable.

    Raises ValueError if another register has no reset, or a retained one has.
    """
    without = {register.name for register in d.registers if register.reset is None}
    if without != retained:
        raise ValueError(f"registers without reset: {sorted(without)}, not {sorted(retained)}")
    was_standby = past(m, standby)
    for register in d.registers:
        if register.reset is None:
            rests = register.value == past(m, register.value)
            text = f"in standby register {register.name} does not change"
            m.d.comb += Assert(~standby | ~was_standby | Initial() | rests, text)
        else:
            text = f"in standby register {register.name} has its reset value"
            m.d.comb += Assert(~standby | (register.value == register.reset), text)


def outputs_rest(
    m: Module, d: SimpleNamespace, standby: Value, pins: Iterable[Pin], but: Collection[str] = ()
) -> None:
    """In standby each output of ``pins`` has its reset level; the ports in ``but`` need not."""
    for port in (port for pin in pins for port in pin.ports):
        if port.output and port.name not in but:
            text = f"in standby {port.name} is {port.level}"
            m.d.comb += Assert(~standby | (getattr(d, port.name) == port.level), text)


def one_sram_driver(m: Module, d: SimpleNamespace, sram: str = "SRAM") -> None:
    """The SRAM drives its data bus while its output enable is low; then the FPGA does not."""
    text = f"FPGA and SRAM never both drive {sram}_D"
    m.d.comb += Assert(~getattr(d, f"{sram}_D_OE") | getattr(d, f"{sram}_OE_N"), text)


def written_is_driven(m: Module, d: SimpleNamespace, sram: str = "SRAM") -> None:
    """While an SRAM is written it is selected, and only the FPGA drives its data bus."""
    one_sram_driver(m, d, sram)
    d_oe, ce_n, we_n = (getattr(d, f"{sram}_{name}") for name in ("D_OE", "CE_N", "WE_N"))
    text = f"while {sram}_WE_N is low the SRAM is selected and the FPGA drives {sram}_D"
    m.d.comb += Assert(we_n | (d_oe & ~ce_n), text)


def acknowledges(m: Module, d: SimpleNamespace, ack: Value, **clocks: Value) -> None:
    """ACK is high exactly while one of the writers has stored all rows; ``clocks`` by writer."""
    complete = [acknowledges_all_rows(m, d, writer, clock) for writer, clock in clocks.items()]
    m.d.comb += Assert(Cat(*complete).any() == ack, ACKNOWLEDGES)


def acknowledges_all_rows(m: Module, d: SimpleNamespace, writer: str, clock: Value) -> Signal:
    """One writer's ACK, derived from its writes; returns the expected ACK.

    ACK is high from the end of the last pixel's write on, and at no other time. Each row begins
    with its first column and follows the previous row of the same frame, so by then all rows are
    stored. ``d`` has the wires of WRITER_WIRES, prefixed with ``writer``.
    """
    columns, rows = d.size.columns, d.size.rows
    wires = SimpleNamespace(**{name: getattr(d, f"{writer}_{name}") for name in WRITER_WIRES})
    column, row, store = wires.column, wires.row, wires.store
    sync = domain(m, f"{writer}_monitor", clock, wires.rst)
    begun = Signal(range(rows + 1), name=f"{writer}_begun")  # rows of this frame
    complete = Signal(name=f"{writer}_complete")
    last_pixel = store & (column == columns - 1) & (row == rows - 1)
    with m.If(~wires.vsync):
        sync += begun.eq(0)
    with m.Elif(store & (column == 0)):
        sync += begun.eq(begun + 1)
    with m.If(last_pixel):
        sync += complete.eq(1)

    in_order = row == begun - (column != 0)
    over = wires.frame_full | wires.ack
    m.d.comb += [
        Assert(wires.ack == complete, ACKNOWLEDGES),
        Assert(~store | in_order, "a row is stored right after the one above it"),
        Assert(~last_pixel | (begun == rows), "all rows are stored before the last pixel is"),
        Assert((column < columns) & (row < rows) & (begun <= rows), AUXILIARY),
        Assert(over | in_order, AUXILIARY),
        Assert(~over | ~store, AUXILIARY),
        Assert(~wires.line_open | store | wires.line_full | (column != 0), AUXILIARY),
    ]
    return complete
