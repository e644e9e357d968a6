"""Which engine is made, with a compiler and without."""

from typing import Any

import pytest

from cubestack.emulator.native.compiler import CompilerError, NoCompilerError
from cubestack.emulator.rtl import factory
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
def test_engines_with_a_compiler(engines: dict[str, Any], skipping: bool) -> None:
    timing = SramTiming()
    options = {"sram_timing": timing, "skipping": skipping}
    for kind, name, skips in (
        ("auto", "compiled", skipping),
        ("compiled", "compiled", skipping),
        ("exact", "compiled", False),
        ("python", "python", skipping),
    ):
        assert make(kind, **options) == (name, "wiring", timing, {"skipping": skips})


def test_without_a_compiler_only_auto_goes_on_and_says_so(engines: dict[str, Any]) -> None:
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
