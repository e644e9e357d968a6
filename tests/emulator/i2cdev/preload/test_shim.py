"""The library of the preload route: built once, cached by its source and compiler."""

import stat

import pytest

from cubestack.emulator.i2cdev.preload import shim
from cubestack.emulator.rtl.cxxrtl.build import CompilerError, NoCompilerError

needs_c = pytest.mark.skipif(shim.find_c_compiler() is None, reason="no C compiler here")


@needs_c
def test_built_once(tmp_path, monkeypatch):
    library = shim.shim_library(tmp_path)
    log = library.with_suffix(".log").read_text()
    assert len(log.splitlines()) == 1, log  # the command, and no warning
    monkeypatch.setattr(shim, "_compile", None)
    assert shim.shim_library(tmp_path) == library


@needs_c
def test_another_source_is_another_library(tmp_path, monkeypatch):
    first = shim.shim_library(tmp_path)
    source = tmp_path / "shim.c"
    source.write_bytes(shim.SOURCE.read_bytes() + b"\n")
    monkeypatch.setattr(shim, "SOURCE", source)
    assert shim.shim_library(tmp_path) != first


def test_a_compiler_that_fails(tmp_path, monkeypatch):
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho cannot; exit 1\n")
    compiler.chmod(compiler.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("CC", str(compiler))
    with pytest.raises(CompilerError, match=r"failed; its log is .*\.log") as raised:
        shim.shim_library(tmp_path)
    log = str(raised.value).rsplit(" ", 1)[1]
    with open(log, encoding="utf-8") as text:
        assert "cannot" in text.read()


def test_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setattr(shim, "find_c_compiler", lambda: None)
    with pytest.raises(NoCompilerError, match=r"no C compiler \(cc, gcc, clang"):
        shim.shim_library(tmp_path)


@needs_c
def test_a_cache_that_can_not_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(CompilerError, match="can not use the cache folder"):
        shim.shim_library(tmp_path / "file" / "cache")
