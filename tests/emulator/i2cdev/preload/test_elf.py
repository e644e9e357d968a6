"""Programs that are linked statically are known by what they lack."""

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cubestack.emulator.i2cdev.preload.shim import find_c_compiler, is_static

TIMEOUT_S = 120


@pytest.mark.parametrize("static", [True, False])
def test_compiled_programs(tmp_path, static):
    compiler = find_c_compiler()
    if compiler is None:
        pytest.skip("no C compiler here")
    source, program = tmp_path / "program.c", tmp_path / "program"
    source.write_text("int main(void) { return 0; }\n")
    options = ["-static"] if static else []
    command = [*compiler, *options, "-o", program, source]
    if subprocess.run(command, capture_output=True, timeout=TIMEOUT_S).returncode:
        pytest.skip("no static C library here")
    assert is_static(program) is static


def test_what_is_no_static_program(tmp_path):
    assert not is_static(Path(sys.executable))
    script = tmp_path / "script"
    script.write_text("#!/bin/sh\n" + "#" * 100)
    assert not is_static(script)
    assert not is_static(tmp_path)
    assert not is_static(tmp_path / "missing")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=120))
def test_any_bytes(tmp_path, rest):
    program = tmp_path / "noise"
    program.write_bytes(b"\x7fELF\x02\x01" + rest)
    assert is_static(program) in (True, False)
