"""arm-none-eabi-gcc, for the programs of these tests."""

import shutil
import subprocess
from pathlib import Path

import pytest

COMPILER = shutil.which("arm-none-eabi-gcc")
needs_compiler = pytest.mark.skipif(
    COMPILER is None, reason="arm-none-eabi-gcc is not installed (Debian: gcc-arm-none-eabi)"
)


def compile_for_m3(*arguments: str | Path) -> None:
    command = [COMPILER or "", "-mcpu=cortex-m3", "-mthumb", *arguments]
    subprocess.run(command, check=True, capture_output=True)


def binary_of(elf: Path) -> bytes:
    """The bytes to load of an ELF file."""
    image = elf.with_suffix(".bin")
    objcopy = (COMPILER or "").replace("gcc", "objcopy")
    subprocess.run([objcopy, "-O", "binary", elf, image], check=True)
    return image.read_bytes()
