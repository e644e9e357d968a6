"""What the terminal shows: results on standard output, progress on standard error."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import TypeVar

from rich import progress as bars
from rich.console import Console
from rich.text import Text

console = Console()
_errors = Console(stderr=True)

T = TypeVar("T")

EVERY_S = 5.0
"""Between two lines that tell how far it is, where there is no terminal to draw a bar on."""


class _Rate(bars.ProgressColumn):
    """How many a second."""

    def render(self, task: bars.Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.3g}/s", style="progress.data.speed")


def say(text: str) -> None:
    """A line for the reader, not for a script: on standard error."""
    _errors.print(text, markup=False, highlight=False, soft_wrap=True)


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
        disable=not _errors.is_terminal,
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
