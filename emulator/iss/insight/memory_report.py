"""Memory use of a program: stacks, heap, static data.

Stack use is the lowest stack pointer that the observer saw. The heap begins at the linker script's
``end``; its use is the highest byte that differs from the observer's start, so memory that is
allocated but never written does not count.
"""

from dataclasses import dataclass

from cubestack.emulator.iss.insight.observer import Observer
from cubestack.emulator.iss.machine import RAM_BASE

ENDS = ("end", "_end", "__end__", "bss_end", "_ebss", "__bss_end__", "ebss")
"""Names of the end of static data in linker scripts, the most reliable one first."""

VECTOR_TABLE = 0xE000_ED08


@dataclass(frozen=True)
class MemoryUse:
    """Bytes; None if unknown."""

    flash: int  #: of the program
    #: flash_size, ram_size: of the part
    flash_size: int
    ram_size: int
    static: int | None  #: data with fixed addresses
    heap: int | None  #: from there to the highest byte written
    stack: int | None  #: deepest use of the main stack
    process_stack: int | None  #: lowest address of the process stack; None if there is none
    free: int | None  #: never used, between heap and main stack


def memory_use(observer: Observer) -> MemoryUse:
    """Memory use of the observed program so far."""
    machine, labels, figures = observer.machine, observer.symbols.labels, observer.figures()
    table = int.from_bytes(machine.peek(VECTOR_TABLE, 4), "little")
    top = int.from_bytes(machine.peek(table, 4), "little")
    end = next((labels[name] for name in ENDS if name in labels), None)
    if end is not None and not RAM_BASE <= end <= RAM_BASE + machine.ram.size:
        end = None
    low = figures.main_sp
    heap = free = None
    if end is not None:
        limit = low if low is not None and low >= end else RAM_BASE + machine.ram.size
        begin, stop = end - RAM_BASE, limit - RAM_BASE
        changed = (machine.ram[begin:stop] != observer.ram_at_start[begin:stop]).nonzero()[0]
        heap = int(changed[-1]) + 1 if changed.size else 0
        free = stop - begin - heap
    segments = machine.image.segments if machine.image is not None else ()
    return MemoryUse(
        flash=sum(len(data) for _, data in segments),
        flash_size=machine.flash.size,
        ram_size=machine.ram.size,
        static=None if end is None else end - RAM_BASE,
        heap=heap,
        stack=None if low is None else top - low,
        process_stack=figures.process_sp,
        free=free,
    )
