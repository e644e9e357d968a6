"""Terminal output: results on standard output, progress on standard error."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, TypeVar

from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from cubestack.firmware_model.formats.untrusted import shown_lines

if TYPE_CHECKING:
    from rich import progress as bars

console = Console()
_errors = Console(stderr=True)

T = TypeVar("T")

Told = Callable[[int, int], None]
"""Callback of progress: (done, total)."""

_WIDEST = 10_000
"""More columns than any table has."""

EVERY_S = 5.0
"""Time between progress lines when standard error is not a terminal."""


def _draws(shown: Console) -> bool:
    return shown.is_terminal and not shown.is_dumb_terminal


def hush(quiet: bool) -> None:
    """Suppress progress and messages while ``quiet``."""
    _errors.quiet = quiet


def say(text: str) -> None:
    """Print a line on standard error, with escapes for characters that a terminal would obey."""
    _errors.print(shown_lines(text), markup=False, highlight=False, soft_wrap=True)


def tell(text: str) -> None:
    """Print a line of a result on standard output, never wrapped.

    On a terminal it appears above the progress bar.
    """
    above = _open[0].console if _open and console.is_terminal else console
    above.print(shown_lines(text), markup=False, soft_wrap=True)


def head(title: str) -> None:
    """Print a title: with a rule if the terminal is wide enough, else plain."""
    if console.is_terminal and len(title) + 4 <= console.width:
        console.rule(Text(shown_lines(title)))
    else:
        tell(f"== {title} ==")


def show(table: Table) -> None:
    """Print a table: drawn if the terminal is wide enough, else as plain lines with all cells.

    Plain is a line for each row, its cells in columns, and the title above.
    """
    table.title = None if table.title is None else _visible(table.title)  # type: ignore[assignment]
    for column in table.columns:
        column.header = _visible(column.header)
        column._cells = [_visible(cell) for cell in column._cells]
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


def _visible(cell: RenderableType) -> RenderableType:
    return shown_lines(cell) if isinstance(cell, str) else cell


def progress_bar() -> "bars.Progress":
    """A progress display on standard error; silent if that is not a terminal."""
    from rich import progress as bars  # most commands show none, and it is slow to load

    class Rate(bars.ProgressColumn):
        """How many a second."""

        def render(self, task: bars.Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{speed:.3g}/s", style="progress.data.speed")

    return bars.Progress(
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        Rate(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
        console=_errors,
        disable=_errors.quiet or not _draws(_errors),
        transient=True,
        redirect_stdout=False,  # it may be a file
    )


def progress(
    items: Iterable[T], total: int, label: str, *, quiet: bool = False, before: int = 0
) -> Iterator[T]:
    """Pass ``items`` through and show progress unless ``quiet``.

    ``before`` of them were done earlier and don't count for the rate.
    """
    with busy(label, before, quiet=quiet) as shown:
        shown(0, total)
        for done, item in enumerate(items, 1):
            yield item
            shown(done, total)


@contextmanager
def busy(label: str, before: int = 0, *, quiet: bool = False) -> Iterator[Told]:
    """Show that ``label`` is in progress during the block; blocks can be nested.

    On a terminal it is a bar; elsewhere a line every `EVERY_S` of wall time for the innermost
    block. Yields a callback for (done, total), of which ``before`` were done earlier. ``quiet``
    shows none.
    """
    if quiet:
        yield lambda _done, _total: None
        return
    if _draws(_errors):
        with _shown_bar() as bar:
            task = bar.add_task(label, total=None)
            try:
                yield lambda done, total: bar.update(task, completed=done, total=total)
            finally:
                bar.remove_task(task)
        return
    teller = _Teller(label, before)
    _telling.append(teller)
    teller.start()
    try:
        yield teller.show
    finally:
        _telling.remove(teller)
        teller.over.set()
        teller.join()


#: The display on the terminal; there is only one.
_open: "list[bars.Progress]" = []

#: Printers of progress lines; the last one is active.
_telling: "list[_Teller]" = []


@contextmanager
def _shown_bar() -> "Iterator[bars.Progress]":
    if _open:
        yield _open[0]
        return
    with progress_bar() as bar:
        _open.append(bar)
        try:
            yield bar
        finally:
            _open.clear()


class _Teller(Thread):
    """Prints progress every few seconds, since one step may take long."""

    def __init__(self, label: str, before: int) -> None:
        super().__init__(daemon=True)
        self.label, self.before = label, before
        self.done = self.total = 0
        self.begun = monotonic()
        self.over = Event()

    def show(self, done: int, total: int) -> None:
        self.done, self.total = done, total

    def run(self) -> None:
        while not self.over.wait(EVERY_S):
            if _telling[-1:] == [self]:
                say(f"{self.label}: {self._text()}")

    def _text(self) -> str:
        took_s = monotonic() - self.begun
        if not self.total:
            return f"{took_s:.0f} s"
        rate = max(0, self.done - self.before) / took_s
        left = f"{rate:.3g}/s, {(self.total - self.done) / rate:.0f} s left" if rate else ""
        return f"{self.done} of {self.total}, {left or f'{took_s:.0f} s'}"
