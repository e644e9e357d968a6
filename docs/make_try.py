"""Builds the page that runs a CubeStar in the browser: `python -m docs.make_try [FOLDER]`.

FOLDER is by default that of the site, which `make docs` has built. The board in C++ becomes
WebAssembly by the compiler of the wheel `ziglang` (extra `compiler`). That takes about a minute the
first time, so nothing that is built is committed.
"""

import argparse
import importlib.util
import json
import math
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np

from cubestack.emulator.boards.cubestar import firmware
from cubestack.emulator.boards.cubestar.layouts import CUBESTAR_POWER
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mlx75412 import sensor
from cubestack.emulator.camera.mlx75412.imager import Corrections, Mlx75412Imager
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.iss import machine
from cubestack.emulator.iss.binding import simulator_options
from cubestack.emulator.iss.image import load_image
from cubestack.emulator.light.pixels import Grey
from cubestack.emulator.rtl import sram
from cubestack.emulator.rtl.cxxrtl.build import driver_options
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.cubestar.memory import EXTERNAL_RAM_BYTES
from cubestack.firmware_model.interface.cameras import mlx75412 as chip
from cubestack.firmware_model.interface.cubestar import INTERFACE, pins
from cubestack.firmware_model.interface.cubestar import processor_pins as wired
from cubestack.firmware_model.interface.efm32gg.pins import pin_number
from cubestack.firmware_model.reference.image import reference_image
from cubestack.host.export.interface import render
from cubestack.host.sensors.cubestar import MAG_LIMIT, POINTING_DEG

PAGE = Path(__file__).parent / "try"
OUT = PAGE.parents[1] / "out"
SITE, SCRATCH = OUT / "site" / "try", OUT / "try"

SKIES = 12
SEED = 41


def constants() -> str:
    """The header that declares to the C++ what the tables of the project declare."""
    return "\n".join(["#pragma once", "#include <cstdint>", *_constants(), ""])


def _constants() -> Iterator[str]:
    wiring = cubestar_wiring()
    assert PS_PER_S % (2 * chip.CRYSTAL_HZ) == 0
    form = LineFormat(INTERFACE.baud)
    numbers = {
        "PIXEL_PERIOD": PS_PER_S // chip.CRYSTAL_HZ,
        "COLUMNS": chip.COLUMNS,
        "ROWS": chip.ROWS,
        "LINE_CLOCKS": chip.LINE_CLOCKS,
        "IDLE_CLOCKS": sensor.IDLE_CLOCKS,
        "MOST_FRAME_LINES": sensor.MOST_FRAME_LINES,
        "FEWEST_FRAME_LINES": sensor.FEWEST_FRAME_LINES,
        "CHARACTER": form.character_ps,
        "LOOK_AHEAD": form.character_ps * 9 // 10,
        "MOST_VIOLATIONS": sram.MAX_VIOLATIONS,
    }
    registers = {one.name: one for one in chip.REGISTERS}
    small = {
        "REMEMBERED": sensor.REMEMBERED,
        "BAUD": INTERFACE.baud,
        "CAMERA_ADDRESS": chip.REGISTERS.i2c_address,
        "SYNC_APPLY": chip.SYNC_APPLY,
        "MODE_SELECT_ENABLE": registers["MODE_SELECT"].field("ENABLE").mask,
        **{
            name: registers[name].address
            for name in ("MODE_SELECT", "SYNC", "CLOCKS_PER_SECOND", "FRAMES_PER_SECOND")
        },
        "FLASH_BYTES": machine.FLASH_BYTES,
        "RAM_BYTES": machine.RAM_BYTES,
        "INFORMATION_BYTES": machine.INFORMATION_BYTES,
        "EXTERNAL_RAM_BYTES": EXTERNAL_RAM_BYTES,
        "SRAM_BYTES": 1 << wiring.widths["SRAM_A"],
        "ANALOG_INPUTS": machine.ANALOG_INPUTS,
        "TEMPERATURE": firmware.TEMPERATURE,
        "SUPPLY": firmware.SUPPLY,
        "UART_TX": wired.SATELLITE_UART.pin("TX"),
        "UART_RX": wired.SATELLITE_UART.pin("RX"),
        "CAMERA_SDA": wired.CAMERA_I2C.pin("SDA"),
        "PIN_CAMERA_RESET": pin_number(wired.CAMERA_RESET),
        **{f"PIN_{pin}": pin_number(wired.FPGA[pin]) for pin in (pins.ENABLE, pins.RNW, pins.BANK)},
    }
    reals = {"SUPPLY_VOLTS": wired.SUPPLY_VOLTS, "CAMERA_TEMPERATURE_C": CONDITION.temperature_c}
    for channel, monitor in wired.MONITORS.items():
        title = channel.upper()
        small[f"PIN_{title}_SWITCH"] = pin_number(wired.SWITCHES[channel])
        small[f"{title}_ADC"] = monitor.adc_channel
        comparator = firmware.COMPARATOR[monitor.comparator] + monitor.comparator_channel
        small[f"{title}_COMPARATOR"] = comparator
        reals[f"{title}_VOLTS_PER_A"] = monitor.volts_per_a
    for name in ("memory", "imager", "fpga"):
        for state, ma in CUBESTAR_POWER.parts[name].ma.items():
            reals[f"{name}_{state}_ma".upper()] = ma
    yield from (f"constexpr int64_t {name} = {value};" for name, value in numbers.items())
    yield from (f"constexpr uint32_t {name} = {value};" for name, value in small.items())
    yield from (f"constexpr double {name} = {value!r};" for name, value in reals.items())
    yield "struct CameraByte { uint16_t address; uint8_t reset; bool synced; };"
    found = (
        f"{{{address}, {byte}, {int(one.needs_sync)}}}"
        for one in chip.REGISTERS
        for address, byte in zip(one.addresses, one.units(one.reset), strict=True)
    )
    yield f"constexpr CameraByte CAMERA_BYTES[] = {{{', '.join(found)}}};"
    coupled = firmware.coupled_pins()
    yield "#define WIRES " + ", ".join(
        f"{{{one.port}, {one.bit}, {one.width}, 0, {int(one.input)}, {int(one.alert)}}}"
        for one in coupled
    )
    names = ", ".join(f'"{one.name}"' for one in coupled)
    yield f"constexpr const char *WIRE_NAMES[] = {{{names}}};"
    timing = ", ".join(str(value) for value in vars(sram.SramTiming()).values())
    yield f"#define SRAM_TIMING_VALUES {timing}"


def build_board(module: Path) -> None:
    """Compile the board to WebAssembly; raises CalledProcessError."""
    SCRATCH.mkdir(parents=True, exist_ok=True)  # always the same, so that zig's cache is of use
    (SCRATCH / "constants.h").write_text(constants())
    options = [*driver_options(cubestar_wiring(), SCRATCH), *simulator_options(SCRATCH)]
    compiler = [sys.executable, "-m", "ziglang", "c++", "-target", "wasm32-wasi"]
    flags = ["-std=c++17", "-O2", "-DNDEBUG", "-fno-exceptions", "-w"]
    linked = ["-mexec-model=reactor", "-Wl,--strip-all"]
    board = PAGE / "board" / "board.cpp"
    call = [*compiler, *flags, *options, board, *linked, "-o", module]
    subprocess.run([str(word) for word in call], check=True)


def firmware_bytes() -> bytes:
    """The reference firmware as it lies in the flash from address 0 on."""
    segments = load_image(reference_image()).segments
    flash = bytearray(b"\xff" * max(address + len(data) for address, data in segments))
    for address, data in segments:
        flash[address : address + len(data)] = data
    return bytes(flash)


def messages() -> str:
    """The messages that the firmware has, as JSON: what the page needs of them."""
    kept = ("name", "type", "bit_offset", "byte_offset", "scale", "unit", "choices")
    told = [
        {key: one[key] for key in ("id", "kind", "name", "length", "meaning")}
        | {"fields": [{key: field[key] for key in kept} for field in one["fields"]]}
        for one in json.loads(render(INTERFACE, "json"))["messages"]
        if one["supported"]
    ]
    return json.dumps(told, separators=(",", ":"))


def skies() -> Iterator[tuple[dict[str, object], bytes]]:
    """Pointing in degrees, and the camera's picture as PNG: Orion, then random directions."""
    generator = np.random.default_rng(SEED)
    rate = INTERFACE.telecommand("SetFrameRate").field("FrameRate").reset
    assert isinstance(rate, int)
    lines = sensor.frame_lines(chip.REGISTERS["CLOCKS_PER_SECOND"].reset, rate)
    line = Fraction(chip.LINE_CLOCKS * PS_PER_S, chip.CRYSTAL_HZ)
    imager = Mlx75412Imager(SEED)
    for number in range(SKIES):
        ra, roll = generator.uniform(0, 360, 2)
        dec = math.degrees(math.asin(generator.uniform(-1, 1)))
        if number == 0:
            ra, dec, roll = POINTING_DEG
        shutter = RollingShutter((number + 1) * PS_PER_S, line, lines - 1, lines - 1)
        scene = SkyScene(quaternion_from_pointing(ra, dec, roll), mag_limit=MAG_LIMIT)
        pixels = imager.render(scene, CONDITION, shutter, Corrections())
        yield {"file": f"sky-{number:02}.png", "ra": ra, "dec": dec}, plain_png(pixels)


def plain_png(pixels: Grey) -> bytes:
    """A PNG of 8-bit grey values without filters: inflated, each row is a 0 and its pixels."""
    rows, columns = pixels.shape
    chunks = {
        b"IHDR": struct.pack(">2I5B", columns, rows, 8, 0, 0, 0, 0),
        b"IDAT": zlib.compress(np.pad(pixels, ((0, 0), (1, 0))).tobytes(), 9),
        b"IEND": b"",
    }
    parts = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks.items()
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def build(folder: Path) -> None:
    """Write all files of the page to ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in PAGE.iterdir():
        if file.is_file():
            shutil.copy(file, folder)
    build_board(folder / "board.wasm")
    (folder / "firmware.bin").write_bytes(firmware_bytes())
    (folder / "messages.json").write_text(messages())
    listed = []
    for about, png in skies():
        (folder / str(about["file"])).write_bytes(png)
        listed.append(about)
    (folder / "skies.json").write_text(json.dumps(listed))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=SITE)
    folder = parser.parse_args().folder
    if importlib.util.find_spec("ziglang") is None:
        parser.error("no package ziglang; install the extra `compiler`")
    build(folder)
    size = sum(file.stat().st_size for file in folder.iterdir() if file.is_file())
    print(f"{folder}: {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
