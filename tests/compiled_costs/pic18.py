"""Count the cycles of the PIC18's operations, compiled by sdcc, on the simulator gpsim.

    .venv/bin/python -m tests.compiled_costs.pic18 FOLDER [--write]

FOLDER is that of build_pic18.sh. `--write` writes the counts to the data file of
``firmware_model/mcu/pic18.py``. The code is for the PIC18F45K20. gpsim does not have that part; its
PIC18F26K22 has the same instructions, cycles and banks.
"""

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.distortion import byte_table
from cubestack.firmware_model.mcu import pic18
from cubestack.firmware_model.mcu.compiled import CompiledCosts, compiled_costs
from cubestack.firmware_model.mcu.costs import Meter
from tests.compiled_costs import pages
from tests.compiled_costs.counting import Operands, counted_names, main, operands_header, output_of
from tests.compiled_costs.pic18_charges import charged_cycles

PAGE = "fidelity-cubesense.md"
SOURCE = Path(__file__).with_suffix(".c")
SIMULATED = "p18f26k22"
OPTIONS = ("-mpic16", "-p18f45k20", "--obanksel=9", "--optimize-df", "--opt-code-speed")
LINKER_SCRIPT = "/usr/share/gputils/lkr/18f45k20_g.lkr"
OPERANDS = 32
ADDRESS_WRITES = 3 * 3 + 4  #: bytes and their clocks; mode and direction, and back

#: Folders of the library's sources, beside the mathematics.
LIBRARY = ("libsdcc/float", "libsdcc/int", "libsdcc/long", "libsdcc/char", "libsdcc/gptr")
MATHEMATICS = ("sqrtf", "atan2f", "atanf", "tanf", "tancotf", "fabsf", "frexpf", "ldexpf")


def operands() -> Operands:
    """Operands as the vision has them, by name: C type and values."""
    rng = np.random.default_rng(18)
    around = rng.uniform(0, 2 * np.pi, OPERANDS)
    pixels = rng.uniform(-300, 300, (2, OPERANDS))
    table = byte_table(Meter(pic18.PIC18F45K20)).differences
    return {
        "left": ("float", [*pixels[0]]),
        "right": ("float", [*pixels[1]]),
        "square": ("float", [*rng.uniform(1, 1e5, OPERANDS)]),
        "angle": ("float", [*rng.uniform(0, 1.5, OPERANDS)]),
        "whole": ("int16_t", [*rng.integers(0, 640, OPERANDS)]),
        "other": ("int16_t", [*rng.integers(1, 480, OPERANDS)]),
        "bytes": ("uint8_t", [*rng.integers(34, 227, OPERANDS)]),
        "columns": ("int16_t", [*(390 + 160 * np.cos(around)).astype(int)]),
        "lines": ("int16_t", [*(230 + 160 * np.sin(around)).astype(int)]),
        "differences": ("uint8_t", [*table]),
    }


def measure(folder: Path) -> CompiledCosts:
    """Compile and count; ``folder`` is that of build_pic18.sh."""
    sdcc = folder / "sdcc"
    names = counted_names(SOURCE)
    with tempfile.TemporaryDirectory() as name:
        program = _compile(sdcc, Path(name), len(names))
        shown = _run(program)
        counts = dict(zip(names, _counts(program, shown, len(names)), strict=True))
    version = output_of(sdcc / "bin" / "sdcc", "--version").splitlines()[0]
    release = re.search(r"Release (\S+)", shown)
    return CompiledCosts(
        compiler=re.sub(r"^SDCC : \S+ ", "sdcc ", version),
        options=" ".join(OPTIONS),
        simulator=f"gpsim {release[1] if release else '?'}, {SIMULATED}",
        operations=_operations(counts),
        routines=_routines(counts),
    )


def _operations(counts: Mapping[str, float]) -> dict[str, float]:
    """Cycles of the cost table's operations, without the cost of counting."""

    def beyond(name: str, plain: str = "nothing") -> float:
        return counts[name] - counts[plain]

    def turn(name: str) -> float:
        return (counts[f"{name}_20"] - counts[f"{name}_10"]) / 10

    floats = ("f32_add", "f32_mul", "f32_div", "f32_sqrt", "f32_atan2", "f32_tan")
    found = {name: beyond(name, "plain_float") for name in floats}
    found |= {name: beyond(name) for name in ("i16_add", "i16_div", "call")}
    found |= {name: beyond(name) for name in ("table_byte", "array_byte")}
    found |= {name: beyond(name) for name in ("port_read", "port_write")}
    return found | {
        "f32_compare": beyond("f32_compare", "plain_branch"),
        "f32_convert": (beyond("int_to_float") + beyond("float_to_int")) / 2,
        "i8": (beyond("i8_store") + beyond("i8_branch")) / 2,
        "loop": turn("loop") - 1,  # the body is one instruction of one cycle
        "loop16": turn("loop16") - 1,
        "strobe_byte": turn("window"),
        "scan_byte": turn("line"),
        # Computing it: its writes to ports and the byte read are charged one by one.
        "address_byte": beyond("addressed") - ADDRESS_WRITES * found["port_write"] - turn("window"),
        "interrupt": beyond("interrupted", "not_interrupted"),
    }


def _routines(counts: Mapping[str, float]) -> dict[str, float]:
    names = ("find_edge", "beyond_rim", "undistort", "add_edge", "solve", "add_pixel")
    return {name: counts[name] - counts["nothing"] for name in names}


def _compile(sdcc: Path, folder: Path, names: int) -> Path:
    """Program, startup code and the library's routines that they need, linked."""
    library = sdcc / "device" / "lib" / "pic16"
    header = operands_header(operands(), OPERANDS=OPERANDS, NAMES=names)
    (folder / "operands.h").write_text(header, "utf-8")
    sources = [SOURCE, SOURCE.with_name("pic18_device.c")]
    sources += [one for part in LIBRARY for one in sorted((library / part).glob("[!e]*.c"))]
    sources += [library / "libm" / f"{name}.c" for name in MATHEMATICS]
    include = sdcc / "device" / "include"
    objects = []
    for source in sources:
        objects.append(folder / f"{source.stem}.o")
        paths = (f"-I{folder}", f"-I{include / 'pic16'}", f"-I{include}")
        options = (*OPTIONS, "--no-warn-non-free", *paths)
        output_of(sdcc / "bin" / "sdcc", *options, "-c", source, "-o", objects[-1])
    output_of("gplink", "-m", "-s", LINKER_SCRIPT, "-o", folder / "program.hex", *objects)
    return folder / "program.hex"


def _run(program: Path) -> str:
    """What gpsim prints: all of the memory, once the program has set `done`."""
    commands = program.with_suffix(".stc")
    done = _places(program)["done"]
    commands.write_text(f"break w {done:#x}\nrun\ndump r\nquit\n", "ascii")
    return output_of("gpsim", "-i", "-p", SIMULATED, program, "-c", commands)


def _places(program: Path) -> dict[str, int]:
    listing = program.with_suffix(".map").read_text("latin-1")
    found = re.findall(r"^\s*_(counts|done)\s+0x(\w+)", listing, re.MULTILINE)
    return {name: int(address, 16) for name, address in found}


def _counts(program: Path, shown: str, names: int) -> NDArray[np.float64]:
    """Mean cycles per operand of everything counted."""
    memory, places = bytearray(4096), _places(program)
    for start, row in re.findall(r"^([0-9a-f]{4}):  ((?:[0-9a-f]{2} ){16})", shown, re.MULTILINE):
        memory[int(start, 16) : int(start, 16) + 16] = bytes.fromhex(row)
    if not memory[places["done"]]:
        raise RuntimeError(f"the program did not end; gpsim: {shown[-500:]}")
    return np.frombuffer(memory, "<u4", names, places["counts"]) / OPERANDS


def tables() -> Mapping[str, str]:
    """Tables of ``PAGE`` by the name of their marks."""
    libraries = {f"`library={name}`": pic18.pic18f45k20(library=name) for name in pic18.LIBRARIES}
    charged = charged_cycles(pic18.pic18f45k20(library="compiled"))
    return {
        "costs": pages.costs_markdown(libraries),
        "routines": pages.routines_markdown(compiled_costs("pic18").routines, charged),
    }


if __name__ == "__main__" and main("pic18", measure):
    pic18.pic18f45k20.cache_clear()
    pages.rewrite(PAGE, tables())
