import threading
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler
from cubestack.host.native import shipped


def test_every_option_of_every_device_is_listed_once() -> None:
    found = [(name, *options.items()) for name, options in shipped.choices()]
    assert len(set(found)) == len(found)
    assert ("cubestar",) in found
    assert ("cubestar", ("layout", "2")) in found
    assert ("cubestar", ("firmware", "reference")) in found
    assert ("cubesense", ("mcu_addressing", True)) in found


def test_devices_with_the_same_design_share_a_library() -> None:
    once = shipped.recipes([("cubestar", {})])
    again = shipped.recipes([("cubestar", {}), ("cubestar", {"profile": "extended"})])
    assert [one.inputs for one in once] == [one.inputs for one in again]
    assert [one.title for one in once] == ["the FPGA design CubeStarTop"]


@pytest.fixture
def compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler with an empty cache."""
    found = Compiler(("c++",), "c++\nc++ of a test")
    for module in (cache.compilers, shipped):
        monkeypatch.setattr(module, "find_compiler", lambda: found)
    for module in (cache, shipped):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)


@pytest.mark.usefixtures("compiler")
def test_missing_libraries_are_compiled_once(capfd: Any) -> None:
    built, lock = list[str](), threading.Lock()

    def recipe(name: str) -> cache.Recipe:
        def build(_compiler: Compiler, scratch: Path, _log: Path) -> Path:
            with lock:
                built.append(name)
            (scratch / "library").write_text(name)
            return scratch / "library"

        return cache.recipe(name, name, [], build)

    recipes = [recipe(name) for name in "abc"]
    shipped.compile_missing(recipes[:1])
    assert built == ["a"]
    shipped.compile_missing(recipes)
    assert sorted(built) == ["a", "b", "c"]
    capfd.readouterr()
    shipped.compile_missing(recipes)
    assert capfd.readouterr() == ("", "")
    assert len(built) == 3


def test_nothing_is_compiled_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped, "find_compiler", lambda: None)
    monkeypatch.setattr(shipped, "library_of", lambda _: pytest.fail("compiled"))
    shipped.compile_missing([cache.recipe("a", "a", [], lambda *_: Path())])
