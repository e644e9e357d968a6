"""The flash over time, and what became of each cut, as SVG."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from cubestack.emulator.iss.flash_changes import PAGE_BYTES, FlashOperation
from cubestack.host.studies.powerfail.cases import KINDS
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.trial import Row

LEFT, STEP, WORD, BAND = 100, 10, 11, 14
"""Lengths in pixels: margin, width of an operation, heights of a word and of a kind of case."""

TEXT, LETTER = 11, 5.2
"""Height of a line of text, and the mean width of a letter."""

PROGRAMMED, ERASED, LINE = "#4b6cb7", "#e9b44c", "#999"
RIGHT_COLOUR, WRONG_COLOUR = "#1a7f37", "#c62828"

MOST_WORDS = 120
"""Rows of a picture: of more words only the first ones are drawn."""


def flash_picture(course: Course, rows: Sequence[Row]) -> str:
    """Operations from left to right: words of the flash above, cuts by their kind below."""
    words = _words(course.operations)
    labels = [*_labels(course)]
    top = TEXT * (max((line for *_, line in labels), default=0) + 1) + 10
    height = top + WORD * len(words) + BAND * (len(KINDS) + 2)
    width = LEFT + STEP * (len(course.operations) + 2)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        'font-family="sans-serif" font-size="10">',
        *_steps(labels, height),
        f'<g transform="translate(0 {top})">',
        *_cells(course.operations, words),
        "</g>",
        *_cuts(rows, top + WORD * len(words) + BAND),
        "</svg>",
    ]
    return "\n".join(parts)


def _words(operations: Sequence[FlashOperation]) -> Mapping[int, int]:
    """Row of each word that is ever programmed, by its address."""
    found = {one.address for each in operations for one in each.changes if not one.erased}
    return {address: row for row, address in enumerate(sorted(found)[:MOST_WORDS])}


def _labels(course: Course) -> Iterator[tuple[int, str, int]]:
    """Place and text of each step's label, and its line, in which it covers no other."""
    ends = list[float]()
    for number, start in enumerate(course.started, start=1):
        x = LEFT + STEP * sum(one.time_ps < start for one in course.operations)
        text = f"step {number}, {start / 1e9:.1f} ms"
        line = next((one for one, end in enumerate(ends) if end < x), len(ends))
        ends[line : line + 1] = [x + LETTER * len(text) + 4]
        yield x, text, line


def _steps(labels: Sequence[tuple[int, str, int]], height: int) -> Iterator[str]:
    """A line where each step begins."""
    for x, text, line in labels:
        y = TEXT * (line + 1)
        yield f'<line x1="{x}" x2="{x}" y1="{y}" y2="{height}" stroke="{LINE}" stroke-width=".5"/>'
        yield f'<text x="{x + 2}" y="{y - 2}">{text}</text>'


def _cells(operations: Sequence[FlashOperation], words: Mapping[int, int]) -> Iterator[str]:
    """A bar for each word from its programming to its erasure."""
    since = dict[int, int]()
    for address, row in words.items():
        if address % PAGE_BYTES == 0 or address - 4 not in words:
            yield f'<text x="2" y="{WORD * (row + 1) - 2}">{address:#010x}</text>'
    for place, operation in enumerate(operations):
        for change in operation.changes:
            if not change.erased:
                since.setdefault(change.address, place)
                continue
            end = change.address + change.size
            inside = [address for address in words if change.address <= address < end]
            for address in inside:
                if address in since:
                    yield _bar(words[address], since.pop(address), place, PROGRAMMED)
                yield _bar(words[address], place, place + 1, ERASED)
    for address, start in since.items():
        if address in words:
            yield _bar(words[address], start, len(operations) + 1, PROGRAMMED)


def _bar(row: int, start: int, end: int, colour: str) -> str:
    x, y = LEFT + STEP * start, WORD * row
    return (
        f'<rect x="{x}" y="{y}" width="{STEP * (end - start)}" height="{WORD - 1}" '
        f'fill="{colour}"/>'
    )


def _cuts(rows: Sequence[Row], top: int) -> Iterator[str]:
    """A mark for the cases of a kind at an operation: right ones, or with a cross if any is not."""
    for place, kind in enumerate(KINDS):
        yield f'<text x="2" y="{top + BAND * place + 9}">{kind}</text>'
    total, wrong = Counter[tuple[str, int]](), Counter[tuple[str, int]]()
    names = dict[tuple[str, int], list[str]]()
    for row in rows:
        key = row.kind, row.operation
        total[key] += 1
        if not row.right:
            wrong[key] += 1
            names.setdefault(key, []).append(f"{row.case} {row.verdict}")
    for (kind, operation), count in total.items():
        x, y = LEFT + STEP * operation, top + BAND * KINDS.index(kind)
        bad = wrong[kind, operation]
        told = f"{kind}, operation {operation}: {bad} of {count} not right"
        told += "".join(f"; case {name}" for name in names.get((kind, operation), [])[:8])
        colour = WRONG_COLOUR if bad else RIGHT_COLOUR
        cross = (
            f'<path d="M{x + 1} {y + 1}l6 8m0 -8l-6 8" stroke="#fff" stroke-width="1.5"/>'
            if bad
            else ""
        )
        yield (
            f'<g><title>{escape(told)}</title><rect x="{x}" y="{y}" width="{STEP - 2}" '
            f'height="{BAND - 4}" fill="{colour}"/>{cross}</g>'
        )
