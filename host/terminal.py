"""What the terminal shows: results on standard output, progress on standard error."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import TypeVar

from rich import progress as bars
from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

console = Console()
_errors = Console(stderr=True)

T = TypeVar("T")

_WIDEST = 10_000
"""Columns that no table has."""

EVERY_S = 5.0
"""Between two lines that tell how far it is, where there is no terminal to draw a bar on."""


class _Rate(bars.ProgressColumn):
    """How many a second."""

    def render(self, task: bars.Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g}/s", style="progress.data.speed")


def hush(quiet: bool) -> None:
    """Show neither progress nor lines for the reader while ``quiet``."""
    _errors.quiet = quiet


def say(text: str) -> None:
    """A line for the reader, not for a script: on standard error."""
    _errors.print(text, markup=False, highlight=False, soft_wrap=True)


def show(table: Table) -> None:
    """Print a table: drawn where the terminal is wide enough, else plain lines that lose nothing.

    Plain is a line for each row, its cells in columns, and the title above.
    """
    options = console.options.update(max_width=_WIDEST)
    width = Measurement.get(console, options, table).maximum
    if console.is_terminal and width <= console.width:
        console.print(table)
        return
    if table.title is not None:
        console.print(table.title, soft_wrap=True, markup=False, highlight=False)
    plain = Table(box=None)
    for column in table.columns:
        plain.add_column(column.header, justify=column.justify, no_wrap=True)
    for cells in zip(*(column.cells for column in table.columns), strict=True):
        plain.add_row(*(_on_one_line(cell) for cell in cells))
    for line in console.render_lines(plain, options, pad=False):
        text = "".join(segment.text for segment in line).rstrip()
        console.print(text, soft_wrap=True, markup=False, highlight=False)


def _on_one_line(cell: RenderableType) -> RenderableType:
    return cell.replace("\n", "  ") if isinstance(cell, str) else cell


def progress_bar() -> bars.Progress:
    """A progress display on standard error; it stays silent when that is no terminal."""
    return bars.Progress(
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        _Rate(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
        console=_errors,
        disable=_errors.quiet or not _errors.is_terminal,
        transient=True,
    )


def progress(
    items: Iterable[T], total: int, label: str, *, quiet: bool = False, before: int = 0
) -> Iterator[T]:
    """Pass ``items`` through with a bar, unless ``quiet``; it may be inside another's loop.

    The first ``before`` of them were done before, and tell nothing about the rate. Off a terminal
    there is a line every `EVERY_S` of wall time instead.
    """
    if quiet:
        yield from items
        return
    if not _errors.is_terminal:
        yield from _told(items, total, label, before)
        return
    with _shown_bar() as bar:
        task = bar.add_task(label, total=total)
        for item in items:
            yield item
            bar.advance(task)


#: The display that is on the terminal; a second one can not be.
_open: list[bars.Progress] = []


@contextmanager
def _shown_bar() -> Iterator[bars.Progress]:
    if _open:
        yield _open[0]
        return
    with progress_bar() as bar:
        _open.append(bar)
        try:
            yield bar
        finally:
            _open.clear()


def _told(items: Iterable[T], total: int, label: str, before: int) -> Iterator[T]:
    """Pass ``items`` through; a thread says how far it is, as one may take long."""
    done, over, begun = 0, Event(), monotonic()

    def tell() -> None:
        while not over.wait(EVERY_S):
            rate = max(0, done - before) / (monotonic() - begun)
            rest = f", {rate:.3g}/s, {(total - done) / rate:.0f} s left" if rate else ""
            say(f"{label}: {done} of {total}{rest}")

    teller = Thread(target=tell, daemon=True)
    teller.start()
    try:
        for item in items:
            yield item
            done += 1
    finally:
        over.set()
        teller.join()
