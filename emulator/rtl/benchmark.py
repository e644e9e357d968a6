"""Measures first builds of the compiled engine."""

import tempfile
import time
from contextlib import suppress
from pathlib import Path

from cubestack.emulator.native.cache import collected
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
    with collected() as recipes, suppress(NoCompilerError):
        library_for(wiring)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = time.perf_counter()
        recipes[0].build(compiler, folder, folder / "log")
        return time.perf_counter() - start
