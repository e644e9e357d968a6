"""Reports of an observed program: profile, coverage and memory use."""

from collections import defaultdict
from dataclasses import dataclass
from typing import IO

from cubestack.emulator.iss.insight.observer import Edge, Observer
from cubestack.emulator.iss.insight.symbols import Symbol
from cubestack.emulator.iss.machine import RAM_BASE

EXCEPTIONS = "(exceptions)"
NOWHERE = "(unknown)"

ENDS = ("end", "_end", "__end__", "bss_end", "_ebss", "__bss_end__", "ebss")
"""Names of the end of static data in linker scripts, the most reliable one first."""

VECTOR_TABLE = 0xE000_ED08


class _Names:
    """Compressed names: the first use writes name and number, later ones the number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def __call__(self, name: str) -> str:
        if name in self._numbers:
            return f"({self._numbers[name]})"
        self._numbers[name] = len(self._numbers) + 1
        return f"({self._numbers[name]}) {name}"


def write_callgrind(observer: Observer, stream: IO[str]) -> None:
    """Write a profile in callgrind's format, which KCachegrind and callgrind_annotate read.

    Valgrind manual, "Callgrind Format Specification". Costs are cycles per source line if known;
    calls include the cycles of everything below them. The caller of exceptions is named
    "(exceptions)".
    """
    symbols, image = observer.symbols, observer.machine.image
    costs: dict[tuple[str, str], dict[tuple[str, int], int]] = defaultdict(lambda: defaultdict(int))
    places: dict[str, tuple[str, str]] = {}

    def place(function: Symbol | None, address: int) -> tuple[str, str]:
        name = function.name if function else NOWHERE
        if name not in places:
            line = symbols.line_at(function.address if function else address)
            places[name] = (line.file if line else NOWHERE, name)
        return places[name]

    def line_of(address: int, file: str) -> tuple[str, int]:
        line = symbols.line_at(address)
        return (line.file, line.number) if line else (file, 0)

    total = 0
    for code in observer.codes:
        for index in code.cycles.nonzero()[0]:
            address, cycles = code.base + 2 * int(index), int(code.cycles[index])
            where = place(symbols.function_at(address), address)
            costs[where][line_of(address, where[0])] += cycles
            total += cycles
    calls: dict[tuple[str, str], list[Edge]] = defaultdict(list)
    for edge in observer.edges():
        if edge.exception:
            calls[NOWHERE, EXCEPTIONS].append(edge)
        else:
            calls[place(symbols.function_at(edge.site), edge.site)].append(edge)

    files, functions = _Names(), _Names()
    stream.write(
        "# callgrind format\nversion: 1\ncreator: cubestack\n"
        f"cmd: {image.path if image and image.path else 'firmware'}\n"
        f"positions: line\nevents: Cycles\nsummary: {total}\n"
    )
    for where in sorted({*costs, *calls}):
        file, name = where
        stream.write(f"\nfl={files(file)}\nfn={functions(name)}\n")
        current = file
        for (of, number), cycles in sorted(costs[where].items()):
            if of != current:
                stream.write(f"{'fe' if of == file else 'fi'}={files(of)}\n")
                current = of
            stream.write(f"{number} {cycles}\n")
        if current != file:
            stream.write(f"fe={files(file)}\n")
        for edge in sorted(calls.get(where, ())):
            target_file, target = place(symbols.function_at(edge.callee), edge.callee)
            number = 0 if edge.exception else line_of(edge.site, file)[1]
            stream.write(
                f"cfi={files(target_file)}\ncfn={functions(target)}\n"
                f"calls={edge.count} {line_of(edge.callee, target_file)[1]}\n"
                f"{number} {edge.cycles}\n"
            )
    stream.write(f"\ntotals: {total}\n")


def write_lcov(observer: Observer, stream: IO[str]) -> None:
    """Write execution counts of source lines as lcov's tracefile (geninfo(1)).

    The count of a line is that of the first instruction of its most frequent statement. A program
    without a line table is one file, whose functions have their addresses as line numbers.
    """
    symbols = observer.symbols
    lines: dict[str, dict[int, int]] = defaultdict(dict)
    for row in symbols.rows:
        if row.statement and row.number:
            found = lines[row.file]
            found[row.number] = max(found.get(row.number, 0), observer.count_of(row.address))
    functions: dict[str, list[tuple[int, str, int]]] = defaultdict(list)
    for function in symbols.functions:
        line, count = symbols.line_at(function.address), observer.count_of(function.address)
        if line is not None:
            functions[line.file].append((line.number, function.name, count))
        elif not symbols.rows:
            image = observer.machine.image
            file = str(image.path) if image and image.path else "firmware"
            functions[file].append((function.address, function.name, count))
            lines[file][function.address] = count
    for file in sorted(lines):
        stream.write(f"TN:\nSF:{file}\n")
        called = sorted(functions[file])
        stream.writelines(f"FN:{number},{name}\n" for number, name, _ in called)
        stream.writelines(f"FNDA:{count},{name}\n" for _, name, count in called)
        stream.write(f"FNF:{len(called)}\nFNH:{sum(count > 0 for _, _, count in called)}\n")
        counts = sorted(lines[file].items())
        stream.writelines(f"DA:{number},{count}\n" for number, count in counts)
        stream.write(f"LF:{len(counts)}\nLH:{sum(count > 0 for _, count in counts)}\n")
        stream.write("end_of_record\n")


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
    """Memory use of the observed program so far: stacks, heap, static data.

    Stack use is the lowest stack pointer that the observer saw. The heap begins at the linker
    script's ``end``; its use is the highest byte that differs from the observer's start, so memory
    that is allocated but never written does not count.
    """
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
