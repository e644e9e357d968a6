"""Builds libraries of driver and design, once each."""

from collections.abc import Iterable
from functools import lru_cache, partial
from pathlib import Path

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, compile_library
from cubestack.emulator.rtl.cxxrtl.edges import edges_after_commit
from cubestack.emulator.rtl.cxxrtl.pins_header import pins_header
from cubestack.emulator.rtl.cxxrtl.variants import has_state_of, variant_text
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.flow.generate import (
    cxxrtl_headers,
    cxxrtl_text,
    design_hash,
    rtlil_text,
    yosys_version,
)

FOLDER = Path(__file__).parent

SOURCES = (
    "*.cpp",
    "*.h",
    "pins_header.py",
    "clock_steps.py",
    "variants.py",
    "strides.py",
    "edges.py",
)
"""Files of this folder that a library depends on."""


def library_for(wiring: Wiring, folder: Path | None = None) -> Path:
    name = wiring.component.title
    return driver_library(name, _design(wiring), partial(_compile, wiring), folder)


@lru_cache(maxsize=8)
def _design(wiring: Wiring) -> str:
    """What a library depends on, apart from SOURCES; cached, as hashing a large design is slow."""
    digest = design_hash(wiring.component)
    return f"{digest}{pins_header(wiring, '')}{wiring.burst_levels}"


def driver_library(name: str, design: str, build: cache.Build, folder: Path | None = None) -> Path:
    """Shared library of the driver with ``design``, shipped, from the cache or built now.

    See :func:`cubestack.emulator.native.cache.library_of`.
    """
    sources = [path for pattern in SOURCES for path in sorted(FOLDER.glob(pattern))]
    tools = yosys_version().encode(), _headers(cxxrtl_headers())
    recipe = cache.recipe(f"the FPGA design {name}", design, sources, build, tools)
    return cache.library_of(recipe, folder)


def compile_driver(
    compiler: Compiler, scratch: Path, log: Path, options: Iterable[str] = ()
) -> Path:
    """Compile driver.cpp with the design.cpp and pins.h of the scratch folder.

    Raises CompilerError; the message names the log.
    """
    sources = f"-I{scratch}", f"-I{cxxrtl_headers()}", FOLDER / "driver.cpp"
    return compile_library(compiler, scratch / "library.so", log, [*sources, *options])


@lru_cache(maxsize=1)
def _headers(folder: Path) -> bytes:
    """All headers of an installed package, one after the other."""
    return b"".join(path.read_bytes() for path in sorted(folder.glob("**/*.h")))


def driver_options(wiring: Wiring, scratch: Path) -> list[str]:
    """Write the design's generated files to ``scratch``; the include folders of driver.cpp."""
    design = edges_after_commit(cxxrtl_text(wiring.component))
    (scratch / "design.cpp").write_text(design)
    rtlil = rtlil_text(wiring.component)
    variants = [
        edges_after_commit(variant_text(rtlil, levels, foreign=wiring.foreign))
        for levels in wiring.burst_levels
    ]
    if not all(has_state_of(design, variant) for variant in variants):
        variants = []
    for number, variant in enumerate(variants):
        (scratch / f"variant_{number}.cpp").write_text(variant)
    (scratch / "pins.h").write_text(pins_header(wiring, design, variants))
    return [f"-I{scratch}", f"-I{cxxrtl_headers()}", f"-I{FOLDER}"]


def _compile(wiring: Wiring, compiler: Compiler, scratch: Path, log: Path) -> Path:
    driver_options(wiring, scratch)
    return compile_driver(compiler, scratch, log)
