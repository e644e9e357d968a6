"""Compiles the small programs of ``firmware/`` for the board."""

import shutil
import subprocess
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.devices.registry import device
from cubestack.host.export.processor import processor_header

PROGRAMS = Path(__file__).parent / "firmware"
COMPILER = shutil.which("arm-none-eabi-gcc")
PART = ("-mcpu=cortex-m3", "-mthumb", "-ffreestanding", "-nostdlib")
FLAGS = (*PART, "-O2", "-g", "-Wall", "-Werror")

needs_toolchain = pytest.mark.skipif(COMPILER is None, reason="needs gcc-arm-none-eabi")
needs_both_compilers = [
    needs_toolchain,
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
]


def build(name: str, folder: Path, *options: str) -> Path:
    (folder / "processor.h").write_text(processor_header(device("cubestar").processor()))
    target = folder / f"{name}.elf"
    inputs = [PROGRAMS / "start.c", PROGRAMS / f"{name}.c", "-T", PROGRAMS / "board.ld", "-lgcc"]
    command = [COMPILER or "", *FLAGS, *options, f"-I{folder}", *inputs, "-o", target]
    subprocess.run(command, check=True)
    return target
