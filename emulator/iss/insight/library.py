"""Declarations of this folder's api.cpp for ctypes."""

import ctypes
from functools import cache

from cubestack.emulator.iss.binding import Functions, Library, declare, simulator


class RangeRecord(ctypes.Structure):
    """``CodeRange`` of insight.h."""

    _fields_ = (
        ("base", ctypes.c_uint32),
        ("size", ctypes.c_uint32),
        ("host", ctypes.c_void_p),
        ("cycles", ctypes.c_void_p),
        ("counts", ctypes.c_void_p),
        ("functions", ctypes.c_void_p),
    )


class EdgeRecord(ctypes.Structure):
    """``Edge`` of insight.h."""

    _fields_ = (
        ("site", ctypes.c_uint32),
        ("callee", ctypes.c_uint32),
        ("count", ctypes.c_uint64),
        ("cycles", ctypes.c_uint64),
    )


class ChangeRecord(ctypes.Structure):
    """``Change`` of insight.h."""

    _fields_ = (
        ("time", ctypes.c_int64),
        ("function", ctypes.c_uint16),
        ("exception", ctypes.c_uint16),
        ("pc", ctypes.c_uint32),
    )


_P, _I, _L = ctypes.c_void_p, ctypes.c_int32, ctypes.POINTER(ctypes.c_int64)
_FUNCTIONS: Functions = {
    "insight_new": (_P, (_P, ctypes.POINTER(RangeRecord), _I)),
    "insight_trace": (None, (_P, _I)),
    "insight_delete": (None, (_P, _P)),
    "insight_finish": (None, (_P,)),
    "insight_edges": (_I, (_P, ctypes.POINTER(EdgeRecord), _I)),
    "insight_changes": (_I, (_P, ctypes.POINTER(ChangeRecord))),
    "insight_figures": (None, (_P, _L)),
    "insight_fault": (None, (_P, _L)),
}


@cache
def insight_library() -> Library:
    """The simulator's library with these functions declared."""
    library = simulator()
    declare(library, _FUNCTIONS)
    return library
