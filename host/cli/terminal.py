"""What the terminal shows: results on standard output, progress on standard error."""

import json
from collections.abc import Iterable, Iterator
from typing import Any, Protocol, TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

__all__ = ["collect", "console", "progress", "progress_bar", "say"]

console = Console()
_errors = Console(stderr=True)

T = TypeVar("T")


class Result(Protocol):
    """What a command measured."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""


R = TypeVar("R", bound=Result)


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
    """Pass ``items`` through with a progress bar; ``quiet`` leaves it out."""
    if quiet:
        yield from items
        return
    with progress_bar() as bar:
        task = bar.add_task(label, total=total)
        for item in items:
            yield item
            bar.advance(task)


def collect(results: Iterable[R], total: int, *, as_json: bool) -> list[R]:
    """All ``results``, ``total`` of them: behind a progress bar, or printed as JSON, one a line."""
    collected = []
    for result in progress(results, total, "measuring", quiet=as_json):
        collected.append(result)
        if as_json:
            print(json.dumps(result.as_dict()), flush=True)
    return collected
