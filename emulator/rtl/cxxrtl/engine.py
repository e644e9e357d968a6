"""The compiled engine: CXXRTL's C++ of the design with driver.cpp around it, through ctypes."""

import ctypes
from collections.abc import Sequence
from dataclasses import astuple, fields
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.emulator.rtl.sram import (
    BETWEEN_FPGAS,
    MAX_VIOLATIONS,
    RULES,
    SramTiming,
    Violation,
    ViolationLog,
)
from cubestack.emulator.rtl.stepping import BurstEnd, SteppingEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.fpga_port import STEPS, Transactions

_KINDS = tuple(RULES)
_BURST_ENDS = tuple(BurstEnd)  # declared in the driver's order


class _Segment(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_int64)
        for name in (
            "start",
            "half_numerator",
            "half_denominator",
            "edges",
            "rows",
            "line_clocks",
            "active_columns",
            "vsync",
        )
    ]


class _Timing(ctypes.Structure):
    _fields_ = [(field.name, ctypes.c_int64) for field in fields(SramTiming)]


class _Violation(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_int64) for name in ("kind", "time", "address", "found", "needed", "where")
    ]


class _Transactions(ctypes.Structure):
    _fields_ = [
        ("addresses", ctypes.c_void_p),
        ("data", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("count", "write", "select", "above")),
        *((name, ctypes.c_int64) for name in ("start", "numerator", "denominator", "cycles")),
        ("offsets", ctypes.c_int64 * STEPS),
    ]


_INT, _LONG, _POINTER = ctypes.c_int32, ctypes.c_int64, ctypes.c_void_p
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "driver_new": (_POINTER, (ctypes.POINTER(_POINTER), ctypes.POINTER(_Timing), _LONG, _INT)),
    "driver_delete": (None, (_POINTER,)),
    "driver_pin": (_INT, (ctypes.c_char_p,)),
    "driver_set": (None, (_POINTER, _INT, ctypes.c_uint32, _LONG)),
    "driver_get": (ctypes.c_uint32, (_POINTER, _INT)),
    "driver_register": (ctypes.c_char_p, (_INT, ctypes.POINTER(_INT))),
    "driver_flip": (None, (_POINTER, _INT, _INT, _LONG)),
    "driver_power": (None, (_POINTER, _INT, _INT, _LONG)),
    "driver_load": (None, (_POINTER, _INT, ctypes.POINTER(_Segment), _LONG)),
    "driver_use_pixels": (None, (_POINTER, _INT, _POINTER)),
    "driver_burst": (
        _INT,
        (_POINTER, _LONG, ctypes.c_uint32, ctypes.POINTER(_LONG), ctypes.POINTER(_INT)),
    ),
    "driver_strobe": (None, (_POINTER, _POINTER, _LONG, _LONG, _LONG, _LONG, _LONG)),
    "driver_access": (
        _LONG,
        (_POINTER, ctypes.POINTER(_Transactions), _LONG, ctypes.c_uint32, ctypes.POINTER(_INT)),
    ),
    "driver_violations": (_LONG, (_POINTER, _LONG, _POINTER)),
    "driver_violation_count": (_LONG, (_POINTER, _INT)),
}


def load_library(path: Path) -> ctypes.CDLL:
    """Open a library of ``build.library_for``, its types declared."""
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


def _registers_of(library: ctypes.CDLL) -> dict[str, int]:
    registers: dict[str, int] = {}
    bits = ctypes.c_int32()
    while (name := library.driver_register(len(registers), bits)) is not None:
        registers[name.decode()] = bits.value
    return registers


class CompiledEngine(SteppingEngine):
    """An ``RtlEngine`` at tens of millions of clocks a second.

    With ``skipping``, a clock outside of lines that changed no register is not repeated.
    """

    def __init__(
        self,
        wiring: Wiring,
        sram_timing: SramTiming | None = None,
        *,
        skipping: bool = True,
        library: Path | None = None,
    ) -> None:
        """Load the library of ``wiring``, building it first where the cache has none.

        ``library`` is another one with the same driver in it.

        Raises:
            CompilerError: there is no C++ compiler, or it failed.
        """
        super().__init__(wiring, skipping=skipping)
        self._driver: int | None = None
        self._library = load_library(library or library_for(wiring))
        addresses = [memory.ctypes.data for memory in self.memories.values()]
        self._driver = self._library.driver_new(
            (_POINTER * len(addresses))(*addresses),
            _Timing(*astuple(sram_timing or SramTiming())),
            MAX_VIOLATIONS,
            skipping,
        )
        self._pins = {name: self._library.driver_pin(name.encode()) for name in wiring.widths}
        self._registers = _registers_of(self._library)
        self._log = ViolationLog()
        self._where = [*self.memories, BETWEEN_FPGAS]  # the driver's -1 is the last one
        self._reached, self._camera = ctypes.c_int64(), ctypes.c_int32()

    def close(self) -> None:
        """Release the driver."""
        if self._driver is not None:
            self._library.driver_delete(self._driver)
            self._driver = None

    def __del__(self) -> None:
        """Release the driver."""
        self.close()

    @property
    def _handle(self) -> int:
        """The driver; without this check a closed one would end the process."""
        if self._driver is None:
            raise RuntimeError("the engine is closed: make a new one")
        return self._driver

    @property
    def violation_log(self) -> ViolationLog:
        """What the SRAM model recorded."""
        for number, kind in enumerate(_KINDS):
            count = self._library.driver_violation_count(self._handle, number)
            if count:
                self._log.counts[kind] = count
        return self._log

    @property
    def registers(self) -> dict[str, int]:
        """Bits of every register."""
        return dict(self._registers)

    def _flip(self, register: str, bit: int) -> None:
        number = list(self._registers).index(register)
        self._library.driver_flip(self._handle, number, bit, self.now_ps)
        self._collect_violations()

    def _set(self, name: str, value: int) -> None:
        self._library.driver_set(self._handle, self._pins[name], value, self.now_ps)
        self._collect_violations()

    def _get(self, name: str) -> int:
        return int(self._library.driver_get(self._handle, self._pins[name]))

    def _power(self, memory: int, on: bool) -> None:
        self._library.driver_power(self._handle, memory, on, self.now_ps)
        self._collect_violations()

    def _load(self, camera: int, loaded: LoadedSegment | None, edge: int) -> None:
        if loaded is None:
            for name in self.wiring.cameras[camera].pins:
                self._set(name, 0)
            return
        segment = loaded.segment
        self._library.driver_load(
            self._handle,
            camera,
            _Segment(
                segment.start_ps,
                loaded.half_period.numerator,
                loaded.half_period.denominator,
                loaded.edges,
                segment.rows,
                loaded.line_clocks,
                loaded.active_columns,
                segment.vsync,
            ),
            edge,
        )

    def _use_pixels(self, camera: int, pixels: NDArray[np.uint8]) -> None:
        # The loaded segment keeps the array alive while the driver reads it.
        self._library.driver_use_pixels(self._handle, camera, pixels.ctypes.data)

    def _burst(self, until_ps: int, cameras: Sequence[int]) -> tuple[int, BurstEnd, int]:
        self._reached.value = self.now_ps
        running = sum(1 << camera for camera in cameras)
        end = self._library.driver_burst(
            self._handle, until_ps, running, self._reached, self._camera
        )
        self._collect_violations()
        return max(self.now_ps, self._reached.value), _BURST_ENDS[end], self._camera.value

    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        if not out.flags.c_contiguous or out.dtype != np.uint8:
            raise ValueError("the target of a transfer must be contiguous uint8")
        half = period / 2
        self._library.driver_strobe(
            self._handle,
            out.ctypes.data,
            len(out),
            self.now_ps,
            half.numerator,
            half.denominator,
            int(fraction * half.denominator),
        )
        self._collect_violations()

    def _access(self, transactions: Transactions) -> int:
        start, period = self.now_ps, transactions.cycle
        given = _Transactions(
            transactions.addresses.ctypes.data,
            transactions.data.ctypes.data,
            len(transactions),
            transactions.write,
            transactions.select,
            transactions.above,
            start,
            period.numerator,
            period.denominator,
            transactions.cycles,
            (ctypes.c_int64 * STEPS)(*transactions.offsets),
        )
        event, over = 0, ctypes.c_int32(not len(transactions))
        while not over.value:
            running = sum(1 << camera.number for camera in self._running())
            event = self._library.driver_access(self._handle, given, event, running, over)
            self._collect_violations()
            if not over.value:
                # A camera wants something before this event.
                self.run(start + transactions.time_of(event))
        return event // STEPS

    def _collect_violations(self) -> None:
        known = len(self._log.kept)
        kept = self._library.driver_violations(self._handle, known, None)
        if kept == known:
            return
        new = (_Violation * (kept - known))()
        self._library.driver_violations(self._handle, known, new)
        for item in new:
            kind, where = _KINDS[item.kind], self._where[item.where]
            self._log.add(
                Violation.measured(kind, item.time, item.address, item.found, item.needed, where)
            )
