"""Builds the simulator's library from all its C++ files, in one call of the compiler."""

from collections.abc import Iterable
from functools import lru_cache, partial
from pathlib import Path

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, compile_library
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.cxx import cxx_header

FOLDER = Path(__file__).parent
LOOP = FOLDER / "armv7m" / "execute" / "loop.cpp"


def sources() -> list[Path]:
    return sorted([*FOLDER.rglob("*.cpp"), *FOLDER.rglob("*.h")])


@lru_cache(maxsize=4)
def simulator_library(folder: Path | None = None) -> Path:
    """See :func:`cubestack.emulator.native.cache.library_of`."""
    header = cxx_header(LAYOUTS)
    build = partial(_compile, header, sources())
    recipe = cache.recipe("the Cortex-M3 simulator", header, sources(), build)
    return cache.library_of(recipe, folder)


def _compile(
    header: str, files: Iterable[Path], compiler: Compiler, scratch: Path, log: Path
) -> Path:
    (scratch / "registers.h").write_text(header)
    units = [file for file in files if file.suffix == ".cpp"]
    # Peripherals import the names of their registers, and the loop defines many macros.
    apart = [file for file in units if FOLDER / "efm32gg" in file.parents or file == LOOP]
    unity = scratch / "simulator.cpp"
    unity.write_text("".join(f'#include "{file}"\n' for file in units if file not in apart))
    return compile_library(
        compiler, scratch / "library.so", log, [f"-I{FOLDER}", f"-I{scratch}", unity, *apart]
    )
