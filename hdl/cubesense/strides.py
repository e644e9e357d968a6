"""Clocks of CubeSense's pair that an engine may run at once, while an FPGA stores its own camera.

Until the first gap between frames the pixels are dropped, then each row is stored. Before and
after, the pixels inside a row are alike, and so are the clocks of the pause that follows it.
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple

from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.fpga import SUN_RUN, SUN_THRESHOLD, ReadOut
from cubestack.hdl.blocks.pinned import Stride
from cubestack.hdl.cubesense.dataflow import Side

_Levels = tuple[tuple[str, int], ...]

#: Where a row's pixels are counted, and the clocks of a pause.
_COLUMN, _LOW = "pix_writer.counter.column", "pix_gap.low_clocks"

#: Registers out of reset; then those of a writer and its gap before and after the first gap.
_RELEASED: _Levels = (("pix_reset.stage0", 0), ("pix_reset.stage1", 0))
_BEFORE: _Levels = (
    ("pix_gap.gap_seen", 0),
    *((f"pix_writer.{name}", 0) for name in ("store", "line_open", "line_full", "frame_full")),
    *((f"pix_writer.{name}", 0) for name in ("ack", "counter.column", "counter.row")),
)
_AFTER: _Levels = (("pix_gap.gap_seen", 1), ("pix_writer.between_lines_seen", 1))
_IN_ROW: _Levels = (
    *((f"pix_writer.{name}", 1) for name in ("store", "line_open")),
    *((f"pix_writer.{name}", 0) for name in ("line_full", "frame_full", "ack")),
    (_LOW, 0),
)
_IN_PAUSE: _Levels = tuple(
    (f"pix_writer.{name}", 0) for name in ("store", "line_open", "line_full")
)


class _Search(NamedTuple):
    """Registers of the FPGA's search of its own camera's image, in each of the states."""

    before: _Levels = ()
    pause: _Levels = ()
    #: names, registers and limits of the pixels of a row's strides
    rows: tuple[tuple[str, _Levels, int], ...] = (("row", (), 256),)


def _search(side: Side, size: ReadOut) -> _Search:
    """A search counts bright pixels, so its strides end before one.

    The printed one ignores pixels once it has found the Sun. The corrected one begins again with
    each frame, and until then the coordinates are all ones.
    """
    if side != "sun":
        return _Search()
    if size.as_printed:
        dark, found = (("search.count", 0),), (("search.count", SUN_RUN),)
        return _Search(rows=(("row", dark, SUN_THRESHOLD), ("row-found", found, 256)))
    none: _Levels = (("search.awake", 1), ("search.run", 0))
    x, y = (1 << size.column_bits) - 1, (1 << size.row_bits) - 1
    before = (*none, ("search.searching", 1), ("search.x", x), ("search.y", y))
    return _Search(before, none, (("row", none, SUN_THRESHOLD),))


def strides_of(side: Side, size: ReadOut) -> Iterator[Stride]:
    """The strides of one half of the pair."""
    search, last = _search(side, size), size.columns - 1
    between = "pix_writer.between_lines_seen"
    for name, levels, below in search.rows:
        state = (*_AFTER, *_IN_ROW, *levels)
        yield _stride(side, name, 1, state, "store", (_COLUMN, last), below)
    pause = (*_AFTER, *_IN_PAUSE, *search.pause)
    yield _stride(side, "pause", 0, pause, "drop", (_LOW, size.frame_gap))
    before = (*_BEFORE, *search.before)
    yield _stride(side, "row-before", 1, (*before, (between, 0), (_LOW, 0)), "drop")
    yield _stride(side, "pause-before", 0, (*before, (between, 1)), "drop", (_LOW, size.frame_gap))


def _stride(
    side: Side,
    name: str,
    href: int,
    state: _Levels,
    access: Literal["store", "drop"],
    counter: tuple[str, int] = ("", 0),
    below: int = 256,
) -> Stride:
    prefix, half = pins.PREFIXES[side], f"{side}."
    enable = dict(zip(pins.PREFIXES, pins.ENABLE, strict=True))[side]
    commands = (enable, pins.SHIFT, pins.EDGE, pins.RNW)
    path, last = counter
    return Stride(
        f"{side}-{name}",
        clock=prefix + pins.PCLK,
        levels=((prefix + pins.HREF, href), *((pin, 0) for pin in commands)),
        state=tuple((half + path, level) for path, level in (*state, *_RELEASED)),
        counter=half + path if path else "",
        last=last,
        data=f"{half}pix_writer.data",
        source=prefix + pins.Y,
        memory=f"{prefix}SRAM",
        access=access,
        below=below,
    )
