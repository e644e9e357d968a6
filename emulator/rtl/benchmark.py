"""How long the compiled engine's first builds take."""

import tempfile
import time
from pathlib import Path

from cubestack.emulator.native.cache import noted
from cubestack.emulator.native.compiler import NoCompilerError, find_compiler
from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.wiring import Wiring

ROUNDS = 5
"""Times that a figure is measured; the best one counts: the others were disturbed."""


def cold_build_s(wiring: Wiring) -> float:
    """Wall time from a design to its shared library by this machine's compiler.

    Raises NoCompilerError.
    """
    compiler = find_compiler()
    if compiler is None:
        raise NoCompilerError("no C++ compiler to measure")
    with tempfile.TemporaryDirectory() as name, noted() as wanted:
        folder = Path(name)
        library_for(wiring, folder)  # one that comes along
        start = time.perf_counter()
        wanted[0].build(compiler, folder, folder / "log")
        return time.perf_counter() - start
