"""Functions and exceptions over time, for traces."""

from collections.abc import Iterator, Mapping

from cubestack.emulator.iss.insight.fault_report import exception_name
from cubestack.emulator.iss.insight.observer import Observer

FUNCTION, EXCEPTION, HANDLER = "function", "exception", "handler"


class History:
    """Converts an observer's changes to variables of a trace."""

    #: bits of each variable by name; None for text
    variables: Mapping[str, int | None] = {FUNCTION: None, EXCEPTION: 8, HANDLER: None}

    def __init__(self, observer: Observer, interrupts: Mapping[int, str]) -> None:
        """Start; ``interrupts``: names of the part's interrupts by number."""
        self._observer = observer
        self._interrupts = interrupts
        self._exception = 0
        observer.trace()

    def take(self) -> Iterator[tuple[int, str, int | str]]:
        """Changes since the last call by time: time in ps, variable, value."""
        for change in self._observer.changes():
            yield change.time_ps, FUNCTION, change.function
            if change.exception != self._exception:
                self._exception = change.exception
                yield change.time_ps, EXCEPTION, change.exception
                yield change.time_ps, HANDLER, exception_name(change.exception, self._interrupts)
