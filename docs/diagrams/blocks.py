"""Block diagrams as SVG: boxes on a grid, and lines between neighbours."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

from docs.diagrams.style import head

ACROSS, DOWN, BOX_WIDTH, BOX_HEIGHT, MARGIN = 296, 128, 156, 68, 16
"""Pixels: from one column and row of the grid to the next, a box, and around all."""

SHAPES = (
    "text{text-anchor:middle;font-size:16px}.title{font-weight:bold}"
    ".label{font-size:13px}.line{stroke-width:1.3;fill:none}"
)
ARROW = (
    '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" '
    'markerHeight="7" orient="auto-start-reverse"><path class="head" d="M0 0L8 4L0 8z"/>'
    "</marker></defs>"
)


class Block(NamedTuple):
    """A box: column and first row on the grid, its title, a line below it, and rows it takes."""

    column: float
    row: float
    title: str
    label: str = ""
    rows: int = 1

    @property
    def last(self) -> float:
        """Its last row."""
        return self.row + self.rows - 1

    @property
    def height(self) -> float:
        """Pixels."""
        return (self.rows - 1) * DOWN + BOX_HEIGHT


class Line(NamedTuple):
    """A connection of two neighbours in a row or column; of a tall box and one beside it in the
    other's row.

    Its label's lines stand above and below it; ``both`` puts an arrow's head on either end.
    """

    source: str
    target: str
    label: str
    both: bool = False


def blocks(boxes: Mapping[str, Block], lines: Sequence[Line]) -> str:
    """The diagram; ValueError for a line between boxes of neither one row nor one column."""
    columns = max(box.column for box in boxes.values())
    rows = max(box.last for box in boxes.values())
    width = 2 * MARGIN + columns * ACROSS + BOX_WIDTH
    height = 2 * MARGIN + rows * DOWN + BOX_HEIGHT
    parts = [*head(width, height, SHAPES), ARROW]
    for line in lines:
        parts += _line(boxes[line.source], boxes[line.target], line)
    for box in boxes.values():
        x, y = _corner(box)
        middle, level = x + BOX_WIDTH / 2, y + box.height / 2
        parts += [
            f'<rect class="box" x="{x:g}" y="{y:g}" width="{BOX_WIDTH}" height="{box.height:g}" '
            'rx="6"/>',
            _text("title", middle, level + (-4 if box.label else 6), box.title),
            _text("label soft", middle, level + 18, box.label),
        ]
    return "\n".join([*parts, "</svg>", ""])


def _corner(box: Block) -> tuple[float, float]:
    return MARGIN + box.column * ACROSS, MARGIN + box.row * DOWN


def _line(source: Block, target: Block, line: Line) -> list[str]:
    heads = 'marker-end="url(#head)"' + (' marker-start="url(#head)"' if line.both else "")
    (x, y), (to_x, to_y) = _corner(source), _corner(target)
    above, _, below = line.label.partition("\n")
    top, bottom = max(source.row, target.row), min(source.last, target.last)
    if source.column != target.column and top <= bottom:
        right, y = to_x > x, MARGIN + (top + bottom) / 2 * DOWN
        start, end = (x + BOX_WIDTH, to_x) if right else (x, to_x + BOX_WIDTH)
        level, middle = y + BOX_HEIGHT / 2, (start + end) / 2
        return [
            f'<path class="line" d="M{start:g} {level:g}H{end:g}" {heads}/>',
            _text("label soft", middle, level - 7, above),
            _text("label soft", middle, level + 18, below),
        ]
    if source.column == target.column:
        down = to_y > y
        start, end = (y + source.height, to_y) if down else (y, to_y + target.height)
        middle, level = x + BOX_WIDTH / 2, (start + end) / 2
        return [
            f'<path class="line" d="M{middle:g} {start:g}V{end:g}" {heads}/>',
            f'<text class="label soft" x="{middle + 8:g}" y="{level:g}" style="text-anchor:start">'
            f"{escape(above)}</text>",
            f'<text class="label soft" x="{middle + 8:g}" y="{level + 16:g}" '
            f'style="text-anchor:start">{escape(below)}</text>',
        ]
    raise ValueError(f"{line.source} and {line.target} are neither in one row nor in one column")


def _text(kind: str, x: float, y: float, text: str) -> str:
    return f'<text class="{kind}" x="{x:g}" y="{y:g}">{escape(text)}</text>' if text else ""
