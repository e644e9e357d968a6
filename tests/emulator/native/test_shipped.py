"""Libraries inside a wheel: used when they fit, never when they don't."""

from pathlib import Path

import pytest

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, NoCompilerError

LIBRARY = b"\x7fELF and so on" * 1000


def build(_compiler: Compiler, _scratch: Path, _log: Path) -> Path:
    raise AssertionError("nothing must be built")


RECIPE = cache.recipe("a design", "design", [], build)


@pytest.fixture(autouse=True)
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The shipped library; there is no compiler."""
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr(cache.compilers, "find_compiler", lambda: None)
    monkeypatch.setattr(cache, "SHIPPED", tmp_path)
    name = f"{cache.hash_of(RECIPE.inputs)}-{cache.hash_of(LIBRARY)}.so"
    (tmp_path / name).write_bytes(LIBRARY)
    return tmp_path / name


def test_is_loaded_without_a_compiler_and_whatever_the_tools(shipped: Path) -> None:
    newer = cache.recipe("a design", "design", [], build, [b"another version of a tool"])
    assert cache.library_of(RECIPE) == cache.library_of(newer) == shipped


@pytest.mark.parametrize("change", [lambda old: old[:-1], lambda old: b"", lambda old: old[::-1]])
def test_damaged_library_is_not_loaded(shipped: Path, change) -> None:
    shipped.write_bytes(change(LIBRARY))
    with pytest.raises(NoCompilerError, match="run: pip install ziglang"):
        cache.library_of(RECIPE)


def test_library_of_another_design_is_not_loaded() -> None:
    with pytest.raises(NoCompilerError):
        cache.library_of(cache.recipe("a design", "another design", [], build))


def test_cxx_chooses_a_compiler_over_the_shipped_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "clang++")
    with pytest.raises(NoCompilerError):
        cache.library_of(RECIPE)


def test_collected_recipes_are_not_built(shipped: Path) -> None:
    with cache.collected() as recipes, pytest.raises(NoCompilerError, match="only listed"):
        cache.library_of(RECIPE)
    assert recipes == [RECIPE]
