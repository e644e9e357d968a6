"""Things that are named by a text, ``"package.module:name"``, and loaded when they are used."""

from collections.abc import Callable
from functools import partial
from pkgutil import resolve_name
from typing import Any


def get(what: str) -> Callable[[], Any]:
    return partial(resolve_name, what)


def call(what: str, *first: Any, **always: Any) -> Callable[..., Any]:
    """A callable that calls it with these arguments, and those that are given then."""

    def called(*given: Any, **options: Any) -> Any:
        return resolve_name(what)(*first, *given, **always, **options)

    return called
