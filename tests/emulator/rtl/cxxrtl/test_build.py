import subprocess
import sys
from dataclasses import replace
from functools import cache as cache_of
from pathlib import Path

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.native import cache as caches
from cubestack.emulator.native import compiler
from cubestack.emulator.rtl.cxxrtl import build
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubestar.top import CubeStarTop
from tests.emulator.conftest import make_compiler
from tests.tiers import quick

TIMEOUT_S = 300

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    # Not by XDG_CACHE_HOME: Yosys would have to fill its own cache anew, which takes seconds.
    folder = tmp_path / "cache"
    monkeypatch.setattr(caches, "cache_folder", lambda: folder)
    for name, text in TEXTS.items():
        monkeypatch.setattr(build, name, text)
    return folder


#: Yosys writes each text once for all tests.
TEXTS = {n: cache_of(getattr(build, n)) for n in ("cxxrtl_text", "rtlil_text", "variant_text")}


@cache_of
def wiring() -> Wiring:
    return cubestar_wiring(CubeStarTop(3, 2))


@pytest.fixture
def quick_compiler(tmp_path, monkeypatch) -> None:
    """Makes a file of the right name, its content telling the options."""
    on_compile = 'for last; do :; done\necho "options $*" | tr -d / >"$last"'
    monkeypatch.setenv("CXX", str(make_compiler(tmp_path, "quickcc", on_compile)))


def test_library_is_built_once_and_then_cached(quick_compiler, cache, monkeypatch):
    library = build.library_for(wiring())
    assert library.parent == cache
    monkeypatch.setattr(build, "_compile", lambda *_: pytest.fail("built again"))
    assert build.library_for(wiring()) == library
    assert sorted(path.suffix for path in cache.iterdir()) == [".log", ".so"]


@pytest.mark.parametrize("damage", quick(["changed", "cut"], 1))
def test_damaged_library_is_built_again(quick_compiler, cache, damage):
    library = build.library_for(wiring())
    content = library.read_bytes()
    library.write_bytes(content[:9] if damage == "cut" else content[:-1] + b"\x55")
    again = build.library_for(wiring())
    assert again.read_bytes().startswith(b"options -std=c++17")
    assert list(cache.glob("*.so")) == [again]


@pytest.mark.slow
def test_library_depends_on_all_its_sources(quick_compiler, cache, monkeypatch):
    libraries = [build.library_for(wiring()), build.library_for(cubestar_wiring(CubeStarTop(2, 3)))]
    monkeypatch.setattr(compiler, "FLAGS", (*compiler.FLAGS, "-g"))
    libraries.append(build.library_for(wiring()))
    monkeypatch.setattr(build, "SOURCES", ("driver.cpp",))
    libraries.append(build.library_for(wiring()))
    libraries.append(build.library_for(replace(wiring(), data="SRAM_A")))
    monkeypatch.setattr(build, "yosys_version", lambda: "999")
    libraries.append(build.library_for(wiring()))
    assert len(set(libraries)) == 6


@pytest.mark.slow
@needs_compiler
def test_two_processes_can_build_the_same_library_at_once(cache):
    program = (
        "from pathlib import Path\n"
        "from cubestack.emulator.native import cache\n"
        f"cache.cache_folder = lambda: Path({str(cache)!r})\n"
        "from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring\n"
        "from cubestack.emulator.rtl.factory import make_engine\n"
        "from cubestack.hdl.cubestar.top import CubeStarTop\n"
        "wiring = cubestar_wiring(CubeStarTop(3, 2))\n"
        "print(make_engine(wiring, 'compiled').get_pin('SRAM_WE_N'))"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [process.communicate(timeout=TIMEOUT_S)[0] for process in started] == ["1\n", "1\n"]
    assert not [path for path in cache.iterdir() if path.is_dir()]


@pytest.mark.slow
@needs_compiler
def test_compiled_engine_is_the_default_and_builds_silently(cache, capfd, recwarn):
    assert isinstance(make_engine(wiring()), CompiledEngine)
    assert capfd.readouterr() == ("", "")
    assert not recwarn.list


def test_compiler_that_fails_is_one_line_with_its_log(cache, tmp_path, monkeypatch, capfd):
    program = make_compiler(tmp_path, "badcc", "echo no such thing >&2; exit 3")
    monkeypatch.setenv("CXX", f"{program} -m64")
    with pytest.raises(compiler.CompilerError) as caught:
        make_engine(wiring())
    (log,) = cache.glob("*.log")
    assert str(caught.value) == f"{program} -m64 failed; its log is {log}"
    assert "no such thing" in log.read_text()
    assert not list(cache.glob("*.so"))
    assert capfd.readouterr() == ("", "")


def test_missing_compiler_falls_back_to_the_simulator_with_a_warning(without_compiler, cache):
    with pytest.warns(UserWarning, match=r"^no C\+\+ compiler .*\); using the Amaranth"):
        engine = make_engine(wiring())
    assert isinstance(engine, SimulatedEngine)
    with pytest.raises(compiler.NoCompilerError, match="run: pip install ziglang"):
        make_engine(wiring(), "compiled")
    assert not cache.exists()


def test_unusable_cache_folder_raises_compiler_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(caches, "cache_folder", lambda: tmp_path / "file" / "cubestack")
    monkeypatch.setenv("CXX", str(make_compiler(tmp_path, "mycc", "exit 1")))
    with pytest.raises(compiler.CompilerError, match="XDG_CACHE_HOME names another one"):
        make_engine(wiring())
