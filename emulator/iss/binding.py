"""Declarations of the functions of api.cpp for ctypes."""

import ctypes
from functools import cache
from typing import Any

from cubestack.emulator.iss.build import simulator_library


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
    "iss_invalidate": (None, (_P, _U, _L)),
    "iss_pin": (None, (_P, _I, _I, _I)),
    "iss_pin_level": (_I, (_P, _I, _I)),
    "iss_uart_receive": (None, (_P, _I, _U, _U)),
    "iss_i2c_slave": (_I, (_P, _I, _I, _I)),
    "iss_i2c_answer": (None, (_P, _I, _I, _I)),
    "iss_analog_changed": (None, (_P,)),
    "iss_breakpoint": (None, (_P, _U, _I)),
    "iss_watchpoint": (None, (_P, _U, _U, _I, _I)),
    "iss_watch_hit": (None, (_P, ctypes.POINTER(_U))),
    "iss_debugger": (None, (_P, _I, _U)),
    "iss_semihosting": (None, (_P, _I)),
    "iss_hang": (None, (_P,)),
    "iss_stop": (None, (_P,)),
    "iss_fpga": (None, (_P, ctypes.POINTER(FpgaDriverRecord), ctypes.POINTER(FpgaWireRecord), _I)),
    "iss_fpga_running": (None, (_P, _U)),
}

Library = Any
"""The loaded library with the functions of api.cpp."""


Functions = dict[str, tuple[Any, tuple[Any, ...]]]
"""Result and argument types by name."""


def declare(library: Library, functions: Functions) -> None:
    for name, (result, arguments) in functions.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


@cache
def simulator() -> Library:
    """The library of this process; CompilerError when it cannot be built."""
    library = ctypes.CDLL(str(simulator_library()))
    declare(library, _FUNCTIONS)
    return library
