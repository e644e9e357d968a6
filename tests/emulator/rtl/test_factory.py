from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import CompilerError, NoCompilerError
from cubestack.emulator.rtl import benchmark, factory
from cubestack.emulator.rtl.sram import SramTiming


@pytest.fixture
def engines(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replaces both; "fails" is the compiler's message."""
    made: dict[str, Any] = {"fails": None}

    def compiled(*arguments: object, **options: object) -> tuple[object, ...]:
        if made["fails"] is not None:
            raise made["fails"]
        return ("compiled", *arguments, options)

    monkeypatch.setattr(factory, "CompiledEngine", compiled)
    monkeypatch.setattr(
        factory, "SimulatedEngine", lambda *arguments, **options: ("python", *arguments, options)
    )
    return made


def make(kind: Any, **options: Any) -> Any:
    return factory.make_engine("wiring", kind, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("skipping", [True, False])
def test_engine_kinds_resolve_with_a_compiler(engines: dict[str, Any], skipping: bool) -> None:
    timing = SramTiming()
    options = {"sram_timing": timing, "skipping": skipping}
    for kind, name, skips in (
        ("auto", "compiled", skipping),
        ("compiled", "compiled", skipping),
        ("exact", "compiled", False),
        ("python", "python", skipping),
    ):
        assert make(kind, **options) == (name, "wiring", timing, {"skipping": skips})


def test_only_auto_falls_back_with_a_warning_without_a_compiler(engines: dict[str, Any]) -> None:
    engines["fails"] = NoCompilerError("no compiler")
    with pytest.warns(UserWarning, match="no compiler; using the Amaranth simulator") as caught:
        assert make("auto")[0] == "python"
    assert caught[0].filename == __file__
    for kind in ("compiled", "exact"):
        with pytest.raises(NoCompilerError):
            make(kind)
    assert make("python")[0] == "python"


def test_reports_failed_compiler(engines: dict[str, Any]) -> None:
    engines["fails"] = CompilerError("broken")
    with pytest.raises(CompilerError, match="broken"):
        make("auto")


def test_cold_build_time_covers_the_compilation_only(monkeypatch: pytest.MonkeyPatch) -> None:
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
    assert benchmark.cold_build_s(None) == 2.5


def test_build_is_not_timed_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "find_compiler", lambda: None)
    with pytest.raises(NoCompilerError, match="no C\\+\\+ compiler to measure"):
        benchmark.cold_build_s(None)
