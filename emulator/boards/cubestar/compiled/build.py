"""Builds of the measuring program (``firmware_model/reference/costs``) by arm-none-eabi-gcc.

A program's cost depends on how it is written as much as on the compiler's options, so a build also
defines a variant of the algorithms' sources:

- `own`: unchanged, in single precision, with its own functions for arc cosine and the like.
- `float`: in single precision, with the library's functions.
- `literals`: constants without the suffix `f`, and the library's double functions for square root
  and arc cosine. Variables stay single; expressions with a constant are computed in double
  precision.
- `double`: all in double precision, except star list and pair list.
"""

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from cubestack.emulator.iss.image import Image, load_image
from cubestack.emulator.native.compiler import CompilerError

REFERENCE = Path(__file__).parents[4] / "firmware_model" / "reference"
LEVELS = ("O0", "O1", "O2", "O3", "Os")
PRECISIONS = ("own", "float", "literals", "double")
COMPILER = "arm-none-eabi-gcc"

FLAGS = (
    *("-std=gnu11", "-mcpu=cortex-m3", "-mthumb", "-ffp-contract=off", "-fno-math-errno"),
    *("-nostartfiles", "--specs=nosys.specs", "-Wl,--no-warn-rwx-segments"),
)

_LITERAL = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|0x[0-9a-f.]+p[+-]?\d+)f\b")


class NoCrossCompilerError(CompilerError):
    """The cross compiler is not installed."""


@dataclass(frozen=True)
class Build:
    """Optimisation level and variant of the sources; ValueError for unknown ones."""

    level: str = "O2"
    precision: str = "own"

    def __post_init__(self) -> None:
        if self.level not in LEVELS or self.precision not in PRECISIONS:
            raise ValueError(
                f"a build is one of {', '.join(LEVELS)} and one of {', '.join(PRECISIONS)}, "
                f"not {self.level} {self.precision}"
            )

    def __str__(self) -> str:
        return f"-{self.level} {self.precision}"


@lru_cache(maxsize=1)
def compiler_version() -> str:
    """First line of the compiler's version text; raises NoCrossCompilerError."""
    program = shutil.which(COMPILER)
    if program is None:
        raise NoCrossCompilerError(
            f"{COMPILER} is not installed: apt install gcc-arm-none-eabi libnewlib-arm-none-eabi"
        )
    answer = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    return answer.stdout.splitlines()[0]


def rewrite_source(text: str, precision: str) -> str:
    """The variant of a C source or header for ``precision``."""
    if precision in ("own", "float"):
        return text
    text = _LITERAL.sub(r"\1", text)
    text = re.sub(r"\b(sqrt|fabs|acos|sin|cos|atan2)f\b", r"\1", text)
    if precision == "double":
        lines = text.splitlines(keepends=True)
        text = "".join(
            line if "typedef float" in line else re.sub(r"\bfloat\b", "double", line)
            for line in lines
        )
    return text


def compile_program(build: Build, generated: dict[str, str]) -> Image:
    """The program; ``generated`` has texts of further sources and headers by file name.

    Raises NoCrossCompilerError.
    """
    compiler_version()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in (*_sources("algorithms"), *_sources("costs")):
            (folder / path.name).write_text(
                rewrite_source(path.read_text("utf-8"), build.precision)
            )
        unused = "library_functions.c" if build.precision == "own" else "float_functions.c"
        (folder / unused).unlink()
        for file, text in generated.items():
            (folder / file).write_text(text)
        program = folder / "program.elf"
        options = (
            f"-{build.level}",
            *FLAGS,
            f"-T{REFERENCE / 'costs' / 'costs.ld'}",
            f"-I{folder}",
        )
        sources = sorted(map(str, folder.glob("*.c")))
        subprocess.run([COMPILER, *options, *sources, "-lm", "-o", str(program)], check=True)
        return load_image(program)


def _sources(folder: str) -> list[Path]:
    return [path for kind in ("*.c", "*.h") for path in sorted((REFERENCE / folder).glob(kind))]
