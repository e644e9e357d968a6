"""Loaders for ``"package.module:name"``: the module is imported on first use."""

from collections.abc import Callable
from functools import partial
from pkgutil import resolve_name
from typing import Any


def get(what: str) -> Callable[[], Any]:
    return partial(resolve_name, what)


def call(what: str, *first: Any, **always: Any) -> Callable[..., Any]:
    """A callable that passes these arguments, then its own, to the named function."""

    def called(*given: Any, **options: Any) -> Any:
        return resolve_name(what)(*first, *given, **always, **options)

    return called
