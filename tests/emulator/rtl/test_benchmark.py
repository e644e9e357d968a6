from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import NoCompilerError
from cubestack.emulator.rtl import benchmark

WIRING: Any = None  #: Nobody looks at it here


def test_the_first_build_alone_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not how long it took to elaborate the design."""
    clock, compiler = SimpleNamespace(now_s=100.0), object()

    def build(given: object, scratch: Path, _log: Path) -> Path:
        assert given is compiler
        clock.now_s += 2.5
        return scratch / "library.so"

    def library_for(_wiring: object) -> Path:
        clock.now_s += 40.0
        return cache.library_of(cache.recipe("a design", "", [], build))

    monkeypatch.setattr(benchmark, "time", SimpleNamespace(perf_counter=lambda: clock.now_s))
    monkeypatch.setattr(benchmark, "find_compiler", lambda: compiler)
    monkeypatch.setattr(benchmark, "library_for", library_for)
    assert benchmark.cold_build_s(WIRING) == 2.5


def test_without_a_compiler_there_is_no_build_to_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "find_compiler", lambda: None)
    with pytest.raises(NoCompilerError, match="no C\\+\\+ compiler to measure"):
        benchmark.cold_build_s(WIRING)
