"""Many short cases as one test: of ``pytest.mark.parametrize``, each costs some milliseconds."""

import functools
import inspect
import reprlib
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

PARAM = type(pytest.param())


def together(
    names: str | Sequence[str],
    cases: Iterable[Any],
    ids: Iterable[str] | Callable[[Any], object] | None = None,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Runs the test with each case, also after one that fails; the failure names those that do.

    Arguments are those of ``pytest.mark.parametrize``. All cases have the same fixtures, so the
    test must not change what they return. A case has no marks.
    """
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else [*names]
    found = list(cases)
    marked = [case for case in found if isinstance(case, PARAM) and case.marks]
    if marked or not found:
        raise TypeError(f"{names}: expected cases without marks, got {marked or 'no case'}")
    own = ids if callable(ids) else None
    labels = [_label(keys, case, own) for case in found] if ids is own else [*(ids or ())]

    def decorated(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def run(**fixtures: Any) -> None:
            failed = dict[str, BaseException]()
            for label, case in zip(labels, found, strict=True):
                try:
                    test(**fixtures, **dict(zip(keys, _values(keys, case), strict=True)))
                except (Exception, pytest.fail.Exception) as error:
                    failed[label] = error
            if failed:
                first = next(iter(failed.values()))
                first.add_note(f"{len(failed)} of {len(found)} cases fail: {'; '.join(failed)}")
                raise first

        own = inspect.signature(test)
        kept = [one for name, one in own.parameters.items() if name not in keys]
        run.__signature__ = own.replace(parameters=kept)  # type: ignore[attr-defined]
        return run

    return decorated


def _values(keys: list[str], case: Any) -> Sequence[Any]:
    if isinstance(case, PARAM):
        return case.values
    return [case] if len(keys) == 1 else case


def _label(keys: list[str], case: Any, own: Callable[[Any], object] | None) -> str:
    if isinstance(case, PARAM) and case.id:
        return str(case.id)
    return ", ".join(
        f"{key}={(own and own(value)) or getattr(value, '__name__', None) or reprlib.repr(value)}"
        for key, value in zip(keys, _values(keys, case), strict=True)
    )
