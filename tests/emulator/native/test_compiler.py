"""Which compiler is taken, and where libraries are kept."""

import sys
from pathlib import Path

from cubestack.emulator.native import cache, compiler
from tests.emulator.fake_compiler import make_compiler


def test_cxx_comes_first_and_version_tells_compilers_apart(tmp_path, monkeypatch):
    monkeypatch.setenv("CXX", str(make_compiler(tmp_path, "mycc", "exit 1", "one")))
    first = compiler.find_compiler()
    assert first is not None
    assert first.command == (str(tmp_path / "mycc"),)
    make_compiler(tmp_path, "mycc", "exit 1", "two")
    assert compiler.find_compiler() != first


def test_broken_compiler_is_passed_over(without_compiler, tmp_path):
    (tmp_path / "c++").write_text("#!/bin/sh\nexit 1\n")
    (tmp_path / "c++").chmod(0o755)
    assert compiler.find_compiler() is None
    make_compiler(tmp_path, "clang++", "exit 1")
    found = compiler.find_compiler()
    assert found is not None
    assert found.command == (str(tmp_path / "clang++"),)


def test_ziglang_wheel_is_the_last_resort(without_compiler, monkeypatch):
    monkeypatch.setattr(
        compiler.importlib.util, "find_spec", lambda name: name == "ziglang" or None
    )
    monkeypatch.setattr(compiler, "version", lambda name: f"7.8 of {name}")
    assert compiler.find_compiler() == compiler.Compiler(
        (sys.executable, "-m", "ziglang", "c++"), "ziglang 7.8 of ziglang"
    )


def test_cache_is_where_the_user_wants_it(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_folder() == tmp_path / "cubestack"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    assert cache.cache_folder() == Path.home() / ".cache" / "cubestack"
