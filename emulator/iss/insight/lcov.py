"""Writes execution counts of source lines as lcov's tracefile (geninfo(1)).

The count of a line is that of the first instruction of its most frequent statement.
"""

from collections import defaultdict
from typing import IO

from cubestack.emulator.iss.insight.observer import Observer


def write_lcov(observer: Observer, stream: IO[str]) -> None:
    """Write the counts of ``observer``; nothing for a program without a line table."""
    symbols = observer.symbols
    lines: dict[str, dict[int, int]] = defaultdict(dict)
    for row in symbols.rows:
        if row.statement and row.number:
            found = lines[row.file]
            found[row.number] = max(found.get(row.number, 0), observer.count_of(row.address))
    functions: dict[str, list[tuple[int, str, int]]] = defaultdict(list)
    for function in symbols.functions:
        line = symbols.line_at(function.address)
        if line is not None:
            count = observer.count_of(function.address)
            functions[line.file].append((line.number, function.name, count))
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
