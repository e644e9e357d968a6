"""Writes a profile in callgrind's format, which KCachegrind and callgrind_annotate read.

Valgrind manual, "Callgrind Format Specification". Costs are cycles per source line if known; calls
include the cycles of everything below them. The caller of exceptions is named "(exceptions)".
"""

from collections import defaultdict
from typing import IO

from cubestack.emulator.iss.insight.observer import Edge, Observer
from cubestack.emulator.iss.insight.symbols import Symbol

EXCEPTIONS = "(exceptions)"
NOWHERE = "(unknown)"


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
    symbols = observer.symbols
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
        f"cmd: {_name(observer)}\npositions: line\nevents: Cycles\nsummary: {total}\n"
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


def _name(observer: Observer) -> str:
    image = observer.machine.image
    return str(image.path) if image is not None and image.path is not None else "firmware"
