"""Compiles programs for the bare part, with the start-up code of the example."""

import shutil
import subprocess
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.devices.registry import device
from cubestack.host.export.processor import processor_header

EXAMPLE = Path(__file__).parents[4] / "examples" / "bare_part"
COMPILER = shutil.which("arm-none-eabi-gcc")
FLAGS = ("-mcpu=cortex-m3", "-mthumb", "-ffreestanding", "-nostdlib", "-Og", "-g", "-Wall")

needs_both_compilers = [
    pytest.mark.skipif(COMPILER is None, reason="needs gcc-arm-none-eabi"),
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
]


def build(folder: Path, name: str, *sources: Path) -> Path:
    tables = device("efm32gg").processor
    assert tables is not None
    (folder / "processor.h").write_text(processor_header(tables()))
    target = folder / f"{name}.elf"
    inputs = [EXAMPLE / "start.c", *sources, "-T", EXAMPLE / "efm32gg.ld", "-lgcc"]
    command = [COMPILER or "", *FLAGS, "-Werror", f"-I{folder}", *inputs, "-o", target]
    subprocess.run(command, check=True)
    return target


def application(folder: Path) -> Path:
    return build(folder, "app", EXAMPLE / "main.c", EXAMPLE / "debounce.c")


def unit_tests(folder: Path) -> Path:
    return build(folder, "unit_tests", EXAMPLE / "unit_tests.c", EXAMPLE / "debounce.c")
