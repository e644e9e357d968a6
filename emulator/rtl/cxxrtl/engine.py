"""The compiled engine: CXXRTL's C++ of the design with driver.cpp, called by ctypes."""

import ctypes
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl import sram
from cubestack.emulator.rtl.contract import BurstEnd, RtlEngine, UnsettledError
from cubestack.emulator.rtl.cxxrtl.build import library_for
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.fpga_port import STEPS, Driver, Transactions

_KINDS = tuple(sram.RULES)
_BURST_ENDS = tuple(BurstEnd)  # declared in the driver's order


_INT, _LONG, _POINTER = ctypes.c_int32, ctypes.c_int64, ctypes.c_void_p
_INT_OUT, _LONGS = ctypes.POINTER(_INT), ctypes.POINTER(_LONG)  # also for structures
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "driver_new": (_POINTER, (ctypes.POINTER(_POINTER), _LONGS, _LONG, _INT)),
    "driver_delete": (None, (_POINTER,)),
    "driver_pin": (_INT, (ctypes.c_char_p,)),
    "driver_use_strides": (None, (_POINTER, _INT)),
    "driver_clocks_at_once": (_LONG, (_POINTER,)),
    "driver_set": (None, (_POINTER, _INT, ctypes.c_uint32, _LONG)),
    "driver_get": (ctypes.c_uint32, (_POINTER, _INT)),
    "driver_replay": (None, (_POINTER, _LONG, *[_POINTER] * 3, _INT, *[_POINTER] * 2)),
    "driver_register": (ctypes.c_char_p, (_INT, _INT_OUT)),
    "driver_flip": (None, (_POINTER, _INT, _INT, _LONG)),
    "driver_state": (_LONG, (_POINTER, _POINTER)),
    "driver_power": (None, (_POINTER, _INT, _INT, _LONG)),
    "driver_load": (None, (_POINTER, _INT, _LONGS, _LONG, _LONG)),
    "driver_use_pixels": (None, (_POINTER, _INT, _POINTER, _LONG)),
    "driver_burst": (_INT, (_POINTER, _LONG, ctypes.c_uint32, _LONGS, _INT_OUT)),
    "driver_strobe": (None, (_POINTER, _POINTER, *[_LONG] * 5)),
    "driver_access": (_LONG, (_POINTER, _LONGS, _LONG, ctypes.c_uint32, _INT_OUT)),
    "driver_violations": (_LONG, (_POINTER, _LONG, _POINTER)),
    "driver_violation_count": (_LONG, (_POINTER, _INT)),
}


def _int64_array(*values: int) -> ctypes.Array[ctypes.c_int64]:
    return (_LONG * len(values))(*values)


class CompiledEngine(RtlEngine):
    """Runs tens of millions of clocks per second.

    With ``skipping``, a clock between lines that changed no register is not repeated, and each
    stride of the design runs in one step.
    """

    def __init__(
        self,
        wiring: Wiring,
        sram_timing: sram.SramTiming | None = None,
        *,
        skipping: bool = True,
        library: Path | None = None,
    ) -> None:
        """Load ``library``, by default that of ``wiring``, which is built if not cached.

        Raises:
            CompilerError: there is no C++ compiler, or it failed.
        """
        super().__init__(wiring, skipping=skipping)
        self._driver: int | None = None
        self._library = ctypes.CDLL(str(library or library_for(wiring)))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(self._library, name)
            function.restype, function.argtypes = result, arguments
        addresses = [memory.ctypes.data for memory in self.memories.values()]
        self._driver = self._library.driver_new(
            (_POINTER * len(addresses))(*addresses),
            _int64_array(*astuple(sram_timing or sram.SramTiming())),
            sram.MAX_VIOLATIONS,
            skipping,
        )
        self._pins = {name: self._library.driver_pin(name.encode()) for name in wiring.widths}
        self._registers: dict[str, int] = {}
        bits = _INT()
        while (name := self._library.driver_register(len(self._registers), bits)) is not None:
            self._registers[name.decode()] = bits.value
        self._places = [*self.memories, sram.BETWEEN_FPGAS]  # the driver's -1 is the last one
        self._reached, self._camera = _LONG(), _INT()

    def close(self) -> None:
        if self._driver is not None:
            self._library.driver_delete(self._driver)
            self._driver = None

    def __del__(self) -> None:
        self.close()

    @property
    def _handle(self) -> int:
        """The driver; with a closed one, C++ would crash the process."""
        if self._driver is None:
            raise RuntimeError("the engine is closed; create a new one")
        return self._driver

    @property
    def driver(self) -> Driver | None:
        """The driver's functions, always the same object; None while an upset is pending."""
        return None if self._upsets else self._functions

    @cached_property
    def _functions(self) -> Driver:
        library = self._library
        functions = library.driver_set, library.driver_get, library.driver_burst
        to_set, to_get, to_burst = (
            ctypes.cast(function, _POINTER).value or 0 for function in functions
        )
        return Driver(self._handle, to_set, to_get, to_burst, self._pins)

    @property
    def violation_counts(self) -> Counter[sram.ViolationKind]:
        for number, kind in enumerate(_KINDS):
            if count := self._library.driver_violation_count(self._handle, number):
                self._log.counts[kind] = count
        return self._log.counts

    @property
    def registers(self) -> dict[str, int]:
        return dict(self._registers)

    @property
    def stride_clocks(self) -> int:
        return int(self._library.driver_clocks_at_once(self._handle))

    def use_strides(self, on: bool) -> None:
        self._library.driver_use_strides(self._handle, on)

    def state(self) -> bytes:
        """Levels of all registers, 4 bytes per 32 bits."""
        words = (ctypes.c_uint32 * self._library.driver_state(self._handle, None))()
        self._library.driver_state(self._handle, words)
        return bytes(words)

    def _flip(self, register: str, bit: int) -> None:
        number = list(self._registers).index(register)
        self._library.driver_flip(self._handle, number, bit, self.now_ps)
        self._collect_violations()

    def _set(self, name: str, value: int) -> None:
        self._library.driver_set(self._handle, self._pins[name], value, self.now_ps)
        self._collect_violations()

    def _get(self, name: str) -> int:
        return int(self._library.driver_get(self._handle, self._pins[name]))

    def replay(
        self,
        times_ps: NDArray[np.int64],
        pins: Sequence[str],
        numbers: NDArray[np.int32],
        levels: NDArray[np.uint32],
        watched: Sequence[str],
    ) -> NDArray[np.uint32]:
        if self._upsets or any(camera.source is not None for camera in self._cameras):
            return super().replay(times_ps, pins, numbers, levels, watched)
        out = np.zeros((len(times_ps), len(watched)), np.uint32)
        if not len(times_ps):
            return out
        self.run(int(times_ps[0]))
        outputs = np.array([self._pins[name] for name in watched], np.int32)
        driven = np.array([self._pins[name] for name in pins], np.int32)[numbers]
        arrays = [np.ascontiguousarray(a) for a in (times_ps, driven, levels)]
        self._library.driver_replay(
            self._handle,
            len(times_ps),
            *(array.ctypes.data for array in arrays),
            len(watched),
            outputs.ctypes.data,
            out.ctypes.data,
        )
        self._idle = False
        self.now_ps = int(times_ps[-1])
        self._collect_violations()
        return out

    def _power(self, memory: int, on: bool) -> None:
        self._library.driver_power(self._handle, memory, on, self.now_ps)
        self._collect_violations()

    def _load(self, camera: int, loaded: LoadedSegment | None, edge: int) -> None:
        if loaded is None:
            for name in self.wiring.cameras[camera].pins:
                self._set(name, 0)
            return
        segment, half = loaded.segment, loaded.half_period
        clock = segment.start_ps, half.numerator, half.denominator, loaded.edges
        lines = segment.rows, loaded.line_clocks, loaded.active_columns, segment.vsync
        segment_now = _int64_array(*clock, *lines), edge, self.now_ps
        self._library.driver_load(self._handle, camera, *segment_now)
        self._collect_violations()

    def _use_pixels(self, camera: int, pixels: NDArray[np.uint8]) -> None:
        # The loaded segment keeps the array alive while the driver reads it.
        self._library.driver_use_pixels(self._handle, camera, pixels.ctypes.data, self.now_ps)
        self._collect_violations()

    def _burst(self, until_ps: int, cameras: Sequence[int]) -> tuple[int, BurstEnd, int]:
        self._reached.value = self.now_ps
        running = sum(1 << camera for camera in cameras)
        reached, camera = self._reached, self._camera
        end = self._library.driver_burst(self._handle, until_ps, running, reached, camera)
        self._collect_violations()
        return max(self.now_ps, reached.value), _BURST_ENDS[end], camera.value

    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        if not out.flags.c_contiguous or out.dtype != np.uint8:
            raise ValueError("the destination of a transfer must be contiguous uint8")
        parts = 2 * period.denominator  # of a ps, for half a period
        halves = period.numerator, parts, fraction.numerator * parts // fraction.denominator
        target, count = out.ctypes.data, len(out)
        self._library.driver_strobe(self._handle, target, count, self.now_ps, *halves)
        self._collect_violations()

    def _access(self, transactions: Transactions) -> int:
        start, cycle = self.now_ps, transactions.cycle
        arrays = transactions.addresses.ctypes.data, transactions.data.ctypes.data
        times = start, cycle.numerator, cycle.denominator, transactions.cycles
        limits = transactions.write, transactions.select, transactions.above
        record = _int64_array(*arrays, len(transactions), *limits, *times, *transactions.offsets)
        event, over = 0, _INT(not len(transactions))
        while not over.value:
            running = sum(1 << camera.number for camera in self._running())
            event = self._library.driver_access(self._handle, record, event, running, over)
            self._collect_violations()
            if not over.value:
                # A camera's segment or acknowledge must be handled before this event.
                self.run(start + transactions.time_of(event))
        return event // STEPS

    def _collect_violations(self) -> None:
        known = len(self._log.kept)
        kept = self._library.driver_violations(self._handle, known, None)
        if kept == known:
            return
        if kept < 0:
            raise UnsettledError(
                f"{self.wiring.component.title} oscillates at {self.now_ps / 1e12:.9f} s: "
                "its logic feeds back into a clock, a reset or a latch, and does not settle"
            )
        new = (_LONG * 6 * (kept - known))()
        self._library.driver_violations(self._handle, known, new)
        for kind, time_ps, address, found, needed, place in new:
            violation = _KINDS[kind], time_ps, address, found, needed, self._places[place]
            self._log.add(sram.Violation(*violation))
