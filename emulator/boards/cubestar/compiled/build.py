"""Builds of the measuring program (``firmware_model/reference/costs``) by arm-none-eabi-gcc.

What a program costs hangs on how it is written as much as on the compiler's options, so a build
also says what becomes of the algorithms' sources:

- `own`: as they are, in single precision, with functions of their own for arc cosine and the like.
- `float`: in single precision, with the library's functions.
- `literals`: as of a programmer who does not write the `f` behind a constant and calls the square
  root and the arc cosine by their usual names. Variables stay single, every expression with a
  constant is computed in double precision.
- `double`: all in double precision; star list and pair list stay single.
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

#: Options of every build.
FLAGS = (
    *("-std=gnu11", "-mcpu=cortex-m3", "-mthumb", "-ffp-contract=off", "-fno-math-errno"),
    *("-nostartfiles", "--specs=nosys.specs", "-Wl,--no-warn-rwx-segments"),
)

_LITERAL = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|0x[0-9a-f.]+p[+-]?\d+)f\b")


class NoCrossCompilerError(CompilerError):
    """The compiler for the part is not there."""


@dataclass(frozen=True)
class Build:
    """How the program is compiled."""

    level: str = "O2"
    precision: str = "own"

    def __post_init__(self) -> None:
        """Refuse what is not known."""
        if self.level not in LEVELS or self.precision not in PRECISIONS:
            raise ValueError(
                f"a build is one of {', '.join(LEVELS)} and one of {', '.join(PRECISIONS)}, "
                f"not {self.level} {self.precision}"
            )

    def __str__(self) -> str:
        """For tables."""
        return f"-{self.level} {self.precision}"


@lru_cache(maxsize=1)
def compiler_version() -> str:
    """First line of what the compiler says of itself.

    Raises NoCrossCompilerError.
    """
    program = shutil.which(COMPILER)
    if program is None:
        raise NoCrossCompilerError(
            f"{COMPILER} is not installed: apt install gcc-arm-none-eabi libnewlib-arm-none-eabi"
        )
    answer = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    return answer.stdout.splitlines()[0]


def rewritten(text: str, precision: str) -> str:
    """A C source or header as it would be in ``precision``."""
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


def compiled(build: Build, generated: dict[str, str]) -> Image:
    """The program; ``generated`` are texts of further sources and headers by name.

    Raises NoCrossCompilerError.
    """
    compiler_version()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in (*_sources("algorithms"), *_sources("costs")):
            (folder / path.name).write_text(rewritten(path.read_text("utf-8"), build.precision))
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
