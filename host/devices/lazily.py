"""Loaders for ``"package.module:name"``: the module is imported on first use."""

from collections.abc import Callable
from functools import partial
from pkgutil import resolve_name
from typing import Any

from cubestack.firmware_model.interface.checks import place_of
from cubestack.host.errors import TargetError


def load(what: str) -> Any:
    """Load it; on failure, raises TargetError with file and line."""
    try:
        return resolve_name(what)
    except Exception as error:
        place = place_of(error.__traceback__, what.split(".")[0].split(":")[0])
        kind = "" if isinstance(error, ValueError | ImportError) else f"{type(error).__name__}: "
        raise TargetError(f"{what} does not load: {place}{kind}{error}") from error


def get(what: str) -> Callable[[], Any]:
    return partial(load, what)


def call(what: str, *first: Any, **always: Any) -> Callable[..., Any]:
    """A callable that passes these arguments, then its own, to the named function."""

    def called(*given: Any, **options: Any) -> Any:
        return load(what)(*first, *given, **always, **options)

    return called
