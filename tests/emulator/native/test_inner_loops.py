"""Libraries of inner loops: built once, and a line where they cannot be."""

import ctypes
from pathlib import Path

import pytest

from cubestack.emulator.native import compiler
from cubestack.emulator.native.cache import collected
from cubestack.emulator.native.compiler import CompilerError, find_compiler
from cubestack.emulator.native.inner_loops import inner_loops
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.mcu.inner_loops import loops_in_use, python_form

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler")


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A loop, and an empty cache folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    file = tmp_path / "fused.cpp"
    text = 'extern "C" double fused(double a, double b, double c) { return a * b + c; }\n'
    file.write_text(text)
    return file


@needs_compiler
def test_products_are_rounded_before_they_are_added(source: Path) -> None:
    library = inner_loops("loops of a test", [source])
    assert library is not None
    library.fused.argtypes, library.fused.restype = [ctypes.c_double] * 3, ctypes.c_double
    one = 1 + 2.0**-30
    assert library.fused(one, one, -one * one) == 0


@needs_compiler
def test_compiler_that_fails_is_an_error(source: Path) -> None:
    source.write_text("no C++")
    with pytest.raises(CompilerError, match="failed; its log is"):
        inner_loops("loops of a test", [source])


def test_without_compiler_one_line_says_that_python_runs(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiler, "find_compiler", lambda: None)
    line = "^no C.. compiler found .*; inner loops run in Python"
    with python_form(), pytest.warns(UserWarning, match=line) as said:
        offer_firmware_loops()
    assert len(said) == 1


def test_a_wheel_has_the_loops() -> None:
    before = loops_in_use()
    with python_form(), collected() as wanted, pytest.warns(UserWarning, match="only listed"):
        offer_firmware_loops()
    assert [one.title for one in wanted] == ["the inner loops of the firmware"]
    assert loops_in_use() is before
