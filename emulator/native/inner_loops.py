"""Libraries of inner loops in C++ whose reference is a form in Python, which runs without them."""

import ctypes
import warnings
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from cubestack.emulator.native.cache import library_of, recipe
from cubestack.emulator.native.compiler import Compiler, NoCompilerError, compile_library

FLAGS = ("-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
"""No multiplication is fused with an addition, so that numbers are rounded as NumPy rounds them.

Neither errno nor traps are used, so that loops with roots and conditions run in vectors.
"""


def inner_loops(title: str, sources: Iterable[Path]) -> ctypes.CDLL | None:
    """Library of the C++ files ``sources``, shipped, from the cache or compiled now.

    None, with a warning, where there is neither a library nor a compiler.
    CompilerError when the compiler fails.
    """
    files = sorted(sources)
    wanted = recipe(title, " ".join(FLAGS), files, partial(_compile, files))
    try:
        return ctypes.CDLL(str(library_of(wanted)))
    except NoCompilerError as error:
        # The text and the place are those of every such library, so that it is printed once.
        warnings.warn(f"{error}; inner loops run in Python, which takes longer", stacklevel=1)
        return None


def _compile(files: Sequence[Path], compiler: Compiler, scratch: Path, log: Path) -> Path:
    unity = scratch / "loops.cpp"
    unity.write_text("".join(f'#include "{one}"\n' for one in files if one.suffix == ".cpp"))
    return compile_library(compiler, scratch / "library.so", log, [*FLAGS, unity])
