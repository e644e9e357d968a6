"""Measures first builds of the compiled engine."""

import tempfile
import time
from pathlib import Path

from cubestack.emulator.native.cache import noted
from cubestack.emulator.native.compiler import NoCompilerError, find_compiler
from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.wiring import Wiring

ROUNDS = 5
"""Repetitions of a measurement; the shortest counts, as other processes disturb the rest."""


def cold_build_s(wiring: Wiring) -> float:
    """Wall time in s to build a design's shared library with this machine's compiler.

    Raises NoCompilerError.
    """
    compiler = find_compiler()
    if compiler is None:
        raise NoCompilerError("no C++ compiler to measure")
    with tempfile.TemporaryDirectory() as name, noted() as wanted:
        folder = Path(name)
        library_for(wiring, folder)  # may be one that is shipped
        start = time.perf_counter()
        wanted[0].build(compiler, folder, folder / "log")
        return time.perf_counter() - start
