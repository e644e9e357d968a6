"""Tables of functions that a test enumerates, filled by decorators where the functions stand."""

from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def registered_in(table: dict[str, F]) -> Callable[..., Callable[[F], F]]:
    """A decorator that enters a function into ``table`` under names that nothing has yet."""

    def named(*names: str) -> Callable[[F], F]:
        def register(function: F) -> F:
            for name in names:
                assert table.setdefault(name, function) is function
            return function

        return register

    return named
