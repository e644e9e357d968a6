"""The simulator's C++ library: its build, and declarations of api.cpp and insight for ctypes."""

import ctypes
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from cubestack.emulator.native import cache as libraries
from cubestack.emulator.native.compiler import Compiler, compile_library
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.cxx import cxx_header

FOLDER = Path(__file__).parent
LOOP = FOLDER / "armv7m" / "execute" / "loop.cpp"


class OutgoingRecord(ctypes.Structure):
    """``Outgoing`` of outbox.h."""

    _fields_ = (
        ("kind", ctypes.c_int32),
        ("unit", ctypes.c_int32),
        ("value", ctypes.c_int64),
        ("extra", ctypes.c_int64),
        ("time_ps", ctypes.c_int64),
        ("text", ctypes.c_char * 96),
    )


ATTEND = ctypes.CFUNCTYPE(
    ctypes.c_uint32, ctypes.c_int64, ctypes.c_int32, ctypes.c_int32, ctypes.c_int64
)
SLOW_GET = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_int32, ctypes.c_int64)
SLOW_SET = ctypes.CFUNCTYPE(None, ctypes.c_int32, ctypes.c_uint32, ctypes.c_int64)
SLOW_EXTERNAL = ctypes.CFUNCTYPE(
    ctypes.c_int32, ctypes.c_int32, ctypes.c_uint32, ctypes.c_int32, ctypes.c_int64
)


class FpgaDriverRecord(ctypes.Structure):
    """``FpgaDriver`` of fpga_link.h."""

    _fields_ = (
        ("driver", ctypes.c_void_p),
        ("set", ctypes.c_void_p),
        ("get", ctypes.c_void_p),
        ("burst", ctypes.c_void_p),
        ("attend", ATTEND),
        ("slow_get", SLOW_GET),
        ("slow_set", SLOW_SET),
        ("slow_external", SLOW_EXTERNAL),
    )


class FpgaWireRecord(ctypes.Structure):
    """``FpgaWire`` of fpga_link.h."""

    _fields_ = tuple(
        (name, ctypes.c_int32) for name in ("port", "bit", "width", "pin", "input", "alert")
    )


class FlashChangeRecord(ctypes.Structure):
    """``FlashChange`` of efm32gg/memory/flash_cells.h."""

    _fields_ = (
        ("time", ctypes.c_int64),
        ("duration", ctypes.c_int64),
        ("address", ctypes.c_uint32),
        ("size", ctypes.c_uint32),
        ("before", ctypes.c_uint32),
        ("after", ctypes.c_uint32),
        ("pc", ctypes.c_uint32),
        ("erased", ctypes.c_int32),
    )


class RangeRecord(ctypes.Structure):
    """``CodeRange`` of insight.cpp."""

    _fields_ = (
        ("base", ctypes.c_uint32),
        ("size", ctypes.c_uint32),
        ("host", ctypes.c_void_p),
        ("cycles", ctypes.c_void_p),
        ("counts", ctypes.c_void_p),
        ("functions", ctypes.c_void_p),
    )


class EdgeRecord(ctypes.Structure):
    """``Edge`` of insight.cpp."""

    _fields_ = (
        ("site", ctypes.c_uint32),
        ("callee", ctypes.c_uint32),
        ("count", ctypes.c_uint64),
        ("cycles", ctypes.c_uint64),
    )


class ChangeRecord(ctypes.Structure):
    """``Change`` of insight.cpp."""

    _fields_ = (
        ("time", ctypes.c_int64),
        ("function", ctypes.c_uint16),
        ("exception", ctypes.c_uint16),
        ("pc", ctypes.c_uint32),
    )


_P, _I, _U, _L = ctypes.c_void_p, ctypes.c_int32, ctypes.c_uint32, ctypes.c_int64
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "iss_new": (_P, (_P, _L, _P, _L, _P, _L, _P, _P, _I, _L)),
    "iss_delete": (None, (_P,)),
    "iss_reset": (None, (_P, _I)),
    "iss_run": (_I, (_P, _L, ctypes.POINTER(_L))),
    "iss_step": (_I, (_P, _L, _U, _U, ctypes.POINTER(_L))),
    "iss_now": (_L, (_P,)),
    "iss_cycles": (_L, (_P,)),
    "iss_next_event": (_L, (_P,)),
    "iss_asleep": (_I, (_P,)),
    "iss_instructions": (_L, (_P,)),
    "iss_hz": (_L, (_P,)),
    "iss_take": (_L, (_P, ctypes.POINTER(OutgoingRecord), _L)),
    "iss_register": (_U, (_P, _I)),
    "iss_set_register": (None, (_P, _I, _U)),
    "iss_peek": (_L, (_P, _U, ctypes.POINTER(ctypes.c_uint8), _L)),
    "iss_poke": (_L, (_P, _U, ctypes.POINTER(ctypes.c_uint8), _L)),
    "iss_load": (_I, (_P, _U, _I, ctypes.POINTER(_U))),
    "iss_store": (_I, (_P, _U, _I, _U)),
    "iss_flash_log": (None, (_P, _I)),
    "iss_flash_changes": (_L, (_P, ctypes.POINTER(FlashChangeRecord), _L)),
    "iss_flash_wear": (None, (_P, _U, _U)),
    "iss_invalidate": (None, (_P, _U, _L)),
    "iss_pin": (None, (_P, _I, _I, _I)),
    "iss_pin_level": (_I, (_P, _I, _I)),
    "iss_pin_volts": (ctypes.c_double, (_P, _I, _I)),
    "iss_uart_receive": (None, (_P, _I, _U, _U)),
    "iss_i2c_slave": (_I, (_P, _I, _I, _I)),
    "iss_i2c_answer": (None, (_P, _I, _I, _I)),
    "iss_analog_changed": (None, (_P,)),
    "iss_breakpoint": (None, (_P, _U, _I)),
    "iss_watchpoint": (None, (_P, _U, _U, _I, _I)),
    "iss_watch_hit": (None, (_P, ctypes.POINTER(_U))),
    "iss_debugger": (None, (_P, _I, _U)),
    "iss_semihosting": (None, (_P, _I)),
    "iss_semihosting_answer": (None, (_P, _U)),
    "iss_hang": (None, (_P,)),
    "iss_stop": (None, (_P,)),
    "iss_fpga": (None, (_P, ctypes.POINTER(FpgaDriverRecord), ctypes.POINTER(FpgaWireRecord), _I)),
    "iss_fpga_running": (None, (_P, _U)),
    "insight_new": (_P, (_P, ctypes.POINTER(RangeRecord), _I)),
    "insight_trace": (None, (_P, _I)),
    "insight_delete": (None, (_P, _P)),
    "insight_finish": (None, (_P,)),
    "insight_edges": (_I, (_P, ctypes.POINTER(EdgeRecord))),
    "insight_changes": (_I, (_P, ctypes.POINTER(ChangeRecord))),
    "insight_figures": (None, (_P, ctypes.POINTER(_L))),
    "insight_fault": (None, (_P, _P)),
}

Library = Any
"""The loaded library with these functions."""


def sources() -> list[Path]:
    return sorted([*FOLDER.rglob("*.cpp"), *FOLDER.rglob("*.h")])


@lru_cache(maxsize=4)
def simulator_library(folder: Path | None = None) -> Path:
    """See :func:`cubestack.emulator.native.cache.library_of`."""
    header = cxx_header(LAYOUTS)
    recipe = libraries.recipe("the Cortex-M3 simulator", header, sources(), _compile)
    return libraries.library_of(recipe, folder)


def simulator_options(scratch: Path) -> list[str | Path]:
    """Write the simulator's generated files to ``scratch``; the options that compile it.

    The options are include folders and source files.
    """
    (scratch / "registers.h").write_text(cxx_header(LAYOUTS))
    units = [file for file in sources() if file.suffix == ".cpp"]
    # Peripherals import the names of their registers, and the loop defines many macros.
    apart = [file for file in units if FOLDER / "efm32gg" in file.parents or file == LOOP]
    unity = scratch / "simulator.cpp"
    unity.write_text("".join(f'#include "{file}"\n' for file in units if file not in apart))
    return [f"-I{FOLDER}", f"-I{scratch}", unity, *apart]


def _compile(compiler: Compiler, scratch: Path, log: Path) -> Path:
    return compile_library(compiler, scratch / "library.so", log, simulator_options(scratch))


@cache
def simulator() -> Library:
    """The library of this process; CompilerError when it cannot be built."""
    library = ctypes.CDLL(str(simulator_library()))
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
