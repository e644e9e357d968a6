"""What the terminal shows: results on standard output, progress on standard error."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

console = Console()
_errors = Console(stderr=True)

T = TypeVar("T")


def say(text: str) -> None:
    """A line for the reader, not for a script: on standard error."""
    _errors.print(text, markup=False, highlight=False)


def progress_bar() -> Progress:
    """A progress display on standard error; it stays silent when that is no terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=_errors,
        disable=not _errors.is_terminal,
        transient=True,
    )


def progress(items: Iterable[T], total: int, label: str, *, quiet: bool = False) -> Iterator[T]:
    """Pass ``items`` through with a progress bar, which may be inside another's loop.

    ``quiet`` leaves it out.
    """
    if quiet:
        yield from items
        return
    with _shown_bar() as bar:
        task = bar.add_task(label, total=total)
        for item in items:
            yield item
            bar.advance(task)


#: The display that is on the terminal; a second one can not be.
_open: list[Progress] = []


@contextmanager
def _shown_bar() -> Iterator[Progress]:
    if _open:
        yield _open[0]
        return
    with progress_bar() as bar:
        _open.append(bar)
        try:
            yield bar
        finally:
            _open.clear()
