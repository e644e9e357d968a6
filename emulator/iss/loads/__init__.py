"""Programs that load the processor, in C: the mixture of CoreMark, and kernels as embench has them.

Each verifies itself: the same source, compiled for the machine at hand, returns the same sum.
"""

import shutil
import subprocess
from pathlib import Path

FOLDER = Path(__file__).parent
COMPILER = shutil.which("arm-none-eabi-gcc")

ROUNDS = {
    "lists_matrices_states": 600,
    "checksums": 2500,
    "filters": 1500,
    "bodies": 1000,
    "searches": 500,
    "packing": 80,
    "long_numbers": 2500,
    "substitutions": 700,
    "trees": 1500,
}
"""The loads, and how many rounds take a tenth of a second."""

SEED = 12345
FLAGS = ("-mcpu=cortex-m3", "-mthumb", "-std=gnu11", "-ffreestanding", "-nostartfiles",
         "-Wl,--no-warn-rwx-segments")  # fmt: skip


def build(name: str, folder: Path, rounds: int, optimization: str = "-O2") -> Path:
    """Compile a load for the part; it ends at ``finished`` with its sum in r0.

    Raises:
        FileNotFoundError: there is no arm-none-eabi-gcc.
        subprocess.CalledProcessError: it failed.
    """
    target = folder / f"{name}{optimization}.elf"
    sizes = (f"-DSEED={SEED}u", f"-DROUNDS={rounds}u")
    files = (FOLDER / f"{name}.c", FOLDER / "start.c", "-T", FOLDER / "load.ld")
    if COMPILER is None:
        raise FileNotFoundError("arm-none-eabi-gcc is not installed (Debian: gcc-arm-none-eabi)")
    command = [COMPILER, optimization, *FLAGS, *sizes, *map(str, files), "-o", str(target)]
    subprocess.run(command, check=True, capture_output=True)
    return target
