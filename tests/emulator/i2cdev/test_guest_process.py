"""Starting programs: routes that are not there say why; the library of the preload route."""

import errno
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cubestack.emulator.i2cdev import guest_process as program
from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.i2cdev.preload import shim
from cubestack.emulator.i2cdev.seccomp.abi import native_abi
from cubestack.emulator.native.compiler import CompilerError, NoCompilerError

needs_abi = pytest.mark.skipif(native_abi() is None, reason="no filter for this machine")


def start(*command: str) -> None:
    nobody = Mock(side_effect=AssertionError("nobody opens a device file here"))
    program.start_filtered(command, {}, DeviceNode(7), nobody)


def test_unsupported_machine_raises_route_error(monkeypatch):
    monkeypatch.setattr(program, "native_abi", lambda: None)
    with pytest.raises(program.RouteError, match=r"system calls of .* are not supported"):
        start("true")


@needs_abi
def test_unreadable_guest_memory_raises_route_error(monkeypatch):
    refuse = Mock(side_effect=PermissionError(errno.EPERM, os.strerror(errno.EPERM)))
    monkeypatch.setattr(program, "read_memory", refuse)
    with pytest.raises(program.RouteError, match=r"no access to the program's memory \(Operation"):
        start("true")


@needs_abi
def test_refused_seccomp_filter_raises_route_error(monkeypatch):
    monkeypatch.setattr(program, "make_filter", lambda _abi: bytes(8))
    with pytest.raises(program.RouteError, match=r"the kernel refuses a seccomp listener \("):
        start("true")


def test_guest_exit_status_includes_signals(tmp_path):
    for script, code in (("exit 3", 3), ("kill -9 $$", 128 + 9)):
        running = program.start_preloaded(["sh", "-c", script], {}, tmp_path / "none.so")
        assert (running.exit_code, running.ended, running.watched()) == (code, True, [])
        running.close()


def test_rejects_programs_that_cannot_be_preloaded(tmp_path, monkeypatch):
    with pytest.raises(program.RouteError, match="has a blank or colon"):
        program.start_preloaded(["sh"], {}, tmp_path / "a b.so")
    monkeypatch.setattr(program, "is_static", lambda _path: True)
    with pytest.raises(program.RouteError, match=r"sh is linked statically, so no library"):
        program.start_preloaded(["sh"], {}, tmp_path / "none.so")


def test_preloads_before_the_libraries_and_options_of_the_user(tmp_path, monkeypatch):
    monkeypatch.setenv("LD_PRELOAD", "theirs.so")
    monkeypatch.setenv("ASAN_OPTIONS", "detect_leaks=0")
    assert program.preload_environment(tmp_path / "ours.so") == {
        "LD_PRELOAD": f"{tmp_path}/ours.so theirs.so",
        "ASAN_OPTIONS": "detect_leaks=0:verify_asan_link_order=0",
    }


needs_c = pytest.mark.skipif(shim.find_c_compiler() is None, reason="no C compiler here")


@needs_c
def test_shim_is_built_once_per_source(tmp_path, monkeypatch):
    library = shim.shim_library(tmp_path)
    (log,) = (path.read_text() for path in tmp_path.glob("*.log"))
    assert len(log.splitlines()) == 1, log  # the command, and no warning
    with monkeypatch.context() as patch:
        patch.setattr(shim, "run_compiler", None)
        assert shim.shim_library(tmp_path) == library
    parts = shutil.copytree(shim.SOURCE.parent, tmp_path / "parts")
    monkeypatch.setattr(shim, "SOURCE", parts / shim.SOURCE.name)
    assert shim.shim_library(tmp_path) == library
    with (parts / "listing.c").open("a") as part:
        part.write("\n")
    monkeypatch.setattr(shim, "run_compiler", None)
    with pytest.raises(TypeError, match="not callable"):
        shim.shim_library(tmp_path)


def test_failed_compiler_raises_an_error_that_names_its_log(tmp_path, monkeypatch):
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho cannot; exit 1\n")
    compiler.chmod(compiler.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("CC", str(compiler))
    with pytest.raises(CompilerError, match=r"failed; its log is .*\.log") as raised:
        shim.shim_library(tmp_path)
    log = str(raised.value).rsplit(" ", 1)[1]
    assert "cannot" in Path(log).read_text()


def test_missing_c_compiler_raises_no_compiler_error(tmp_path, monkeypatch):
    monkeypatch.setattr(shim, "find_c_compiler", lambda: None)
    with pytest.raises(NoCompilerError, match=r"no C compiler \(cc, gcc, clang"):
        shim.shim_library(tmp_path)


@needs_c
def test_unwritable_cache_folder_raises_compiler_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(CompilerError, match="can not use the cache folder"):
        shim.shim_library(tmp_path / "file" / "cache")


@needs_c
@pytest.mark.parametrize("static", [True, False])
def test_is_static_detects_statically_linked_programs(tmp_path, static):
    source, program = tmp_path / "program.c", tmp_path / "program"
    source.write_text("int main(void) { return 0; }\n")
    options = ["-static"] if static else []
    command = [*shim.find_c_compiler(), *options, "-o", program, source]
    if subprocess.run(command, capture_output=True, timeout=120).returncode:
        pytest.skip("no static C library here")
    assert shim.is_static(program) is static


def test_rejects_programs_that_are_not_static(tmp_path):
    script = tmp_path / "script"
    script.write_text("#!/bin/sh\n" + "#" * 100)
    for path in (Path(sys.executable), script, tmp_path, tmp_path / "missing"):
        assert not shim.is_static(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=120))
def test_is_static_accepts_arbitrary_elf_bytes(tmp_path, rest):
    program = tmp_path / "noise"
    program.write_bytes(b"\x7fELF\x02\x01" + rest)
    assert shim.is_static(program) in (True, False)
