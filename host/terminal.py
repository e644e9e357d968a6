"""What the terminal shows: results on standard output, progress on standard error."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich import progress as bars
from rich.console import Console

console = Console()
_errors = Console(stderr=True)

T = TypeVar("T")


def say(text: str) -> None:
    """A line for the reader, not for a script: on standard error."""
    _errors.print(text, markup=False, highlight=False, soft_wrap=True)


def progress_bar() -> bars.Progress:
    """A progress display on standard error; it stays silent when that is no terminal."""
    return bars.Progress(
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        bars.TimeElapsedColumn(),
        bars.TimeRemainingColumn(),
        console=_errors,
        disable=not _errors.is_terminal,
        transient=True,
    )


def progress(items: Iterable[T], total: int, label: str, *, quiet: bool = False) -> Iterator[T]:
    """Pass ``items`` through with a bar, unless ``quiet``; it may be inside another's loop."""
    if quiet:
        yield from items
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
