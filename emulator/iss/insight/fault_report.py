"""Fault report of one screen: fault status in words, registers, stacked frame, backtrace.

ARMv7-M Architecture Reference Manual, B3.2.15 to B3.2.18 (fault status registers) and B1.5.6 (the
stack frame).
"""

import ctypes
from collections.abc import Iterator, Mapping
from types import MappingProxyType

from cubestack.emulator.iss.binding import simulator
from cubestack.emulator.iss.insight.backtrace import PSP, backtrace
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine

EXCEPTIONS = {
    0: "", 1: "Reset", 2: "NMI", 3: "HardFault", 4: "MemManage", 5: "BusFault", 6: "UsageFault",
    11: "SVCall", 12: "DebugMonitor", 14: "PendSV", 15: "SysTick",
}  # fmt: skip
FIRST_INTERRUPT = 16
FAULTS = (3, 4, 5, 6)

CFSR = {
    0: ("MemManage", "IACCVIOL", "instruction fetch from where execution is forbidden"),
    1: ("MemManage", "DACCVIOL", "data access that the MPU forbids"),
    3: ("MemManage", "MUNSTKERR", "unstacking after an exception is forbidden"),
    4: ("MemManage", "MSTKERR", "stacking for an exception is forbidden: stack overflow?"),
    7: ("MemManage", "MMARVALID", ""),
    8: ("BusFault", "IBUSERR", "instruction fetch from an unused address"),
    9: ("BusFault", "PRECISERR", "data access to an unused address"),
    10: ("BusFault", "IMPRECISERR", "earlier write to an unused address; pc is after it"),
    11: ("BusFault", "UNSTKERR", "unstacking after an exception failed"),
    12: ("BusFault", "STKERR", "stacking for an exception failed: stack overflow?"),
    15: ("BusFault", "BFARVALID", ""),
    16: ("UsageFault", "UNDEFINSTR", "undefined instruction"),
    17: ("UsageFault", "INVSTATE", "not in Thumb state: a jump to an even address?"),
    18: ("UsageFault", "INVPC", "invalid return from an exception"),
    19: ("UsageFault", "NOCP", "no such coprocessor"),
    24: ("UsageFault", "UNALIGNED", "unaligned access"),
    25: ("UsageFault", "DIVBYZERO", "division by zero"),
}
"""Fault, name and meaning by the bit of the configurable fault status register."""

HFSR = {
    1: ("HardFault", "VECTTBL", "the vector table cannot be read"),
    30: ("HardFault", "FORCED", "a fault whose own handler is disabled or cannot run now"),
    31: ("HardFault", "DEBUGEVT", "BKPT without a debugger"),
}
MMARVALID, BFARVALID = 1 << 7, 1 << 15

BRANCH_TO_SELF = b"\xfe\xe7"
"""``b .``, a handler's endless loop."""

REPORTED_FRAMES = 12


class FaultRecord(ctypes.Structure):
    """``FaultRecord`` of system.h: the last fault."""

    _fields_ = (
        *((name, ctypes.c_uint32) for name in (
            "exception", "cfsr", "hfsr", "dfsr", "mmfar", "bfar", "pc", "frame", "exc_return",
            "count",
        )),
        ("cycle", ctypes.c_int64),
    )  # fmt: skip


def exception_name(number: int, interrupts: Mapping[int, str] = MappingProxyType({})) -> str:
    """Name of an exception; ``interrupts``: names of the part's interrupts by number, from 0."""
    if number - FIRST_INTERRUPT in interrupts:
        return interrupts[number - FIRST_INTERRUPT]
    if number >= FIRST_INTERRUPT:
        return f"IRQ{number - FIRST_INTERRUPT}"
    return EXCEPTIONS.get(number, f"exception {number}")


def last_fault(machine: Machine) -> FaultRecord:
    """The last fault; its ``count`` is 0 if there was none since power-on."""
    record = FaultRecord()
    simulator().insight_fault(machine.handle, ctypes.byref(record))
    return record


def unhandled(machine: Machine) -> bool:
    """Whether it is in a fault handler that only branches to itself."""
    if machine.register("xpsr") & 0x1FF not in FAULTS:
        return False
    return machine.peek(machine.register("pc"), 2) == BRANCH_TO_SELF


def fault_report(machine: Machine, symbols: Symbols, time_ps: int) -> str:
    """Report about the last fault of ``machine`` and its present state."""
    return "\n".join(_lines(machine, symbols, last_fault(machine), time_ps))


def reasons(cfsr: int, hfsr: int) -> list[str]:
    """Meanings of the bits that are set."""
    words = []
    for table, value in ((CFSR, cfsr), (HFSR, hfsr)):
        for bit, (fault, name, meaning) in table.items():
            if value >> bit & 1 and meaning:
                words.append(f"{fault} {name}: {meaning}")
    return words


def _lines(machine: Machine, symbols: Symbols, fault: FaultRecord, time_ps: int) -> Iterator[str]:
    where = f"at {time_ps / 1e12:.9f} s"
    values = {number: machine.register(f"r{number}") for number in range(16)}
    values[PSP] = machine.register("psp")
    xpsr, active = machine.register("xpsr"), machine.register("xpsr") & 0x1FF
    if not fault.count:
        yield f"firmware: no fault so far, {where}"
    else:
        what = exception_name(fault.exception) or "lock-up"
        yield f"firmware: {what} {where}, core cycle {fault.cycle}"
        for reason in reasons(fault.cfsr, fault.hfsr):
            yield f"  {reason}"
        status = f"  CFSR {fault.cfsr:08x}  HFSR {fault.hfsr:08x}  DFSR {fault.dfsr:08x}"
        if fault.cfsr & MMARVALID:
            status += f"  MMFAR {fault.mmfar:08x}"
        if fault.cfsr & BFARVALID:
            status += f"  BFAR {fault.bfar:08x}"
        yield status
        yield f"  faulting instruction {symbols.describe(fault.pc)}"
        yield from _frame(machine, symbols, fault)
    mode = f"in {exception_name(active)}" if active else "in Thread mode"
    yield f"  now {mode}:"
    for first in range(0, 16, 4):
        names = ("sp", "lr", "pc")
        words = (
            f"{names[n - 13] if n > 12 else f'r{n}':>4} {values[n]:08x}"
            for n in range(first, first + 4)
        )
        yield "  " + " ".join(words)
    masks = (f"{name} {machine.register(name):x}" for name in ("primask", "basepri", "faultmask"))
    special = f"msp {machine.register('msp'):08x}  psp {values[PSP]:08x}"
    yield f"  xpsr {xpsr:08x}  {special}  {'  '.join(masks)}"
    yield "  backtrace:"
    for number, frame in enumerate(backtrace(symbols, values, machine.peek)[:REPORTED_FRAMES]):
        note = f"  [{frame.note}]" if frame.note else ""
        yield f"    #{number} {symbols.describe(frame.address, frame.place)}{note}"


def _frame(machine: Machine, symbols: Symbols, fault: FaultRecord) -> Iterator[str]:
    if not fault.frame:
        yield "  no stacked frame: stacking failed"
        return
    data = machine.peek(fault.frame, 32)
    if len(data) < 32:
        return
    r0, r1, r2, r3, r12, lr, pc, psr = memoryview(data).cast("I")
    yield f"  stacked at {fault.frame:08x}: r0 {r0:08x}  r1 {r1:08x}  r2 {r2:08x}  r3 {r3:08x}"
    yield f"    r12 {r12:08x}  xpsr {psr:08x}  lr {symbols.describe(lr & ~1)}"
    yield f"    pc {symbols.describe(pc)}"
