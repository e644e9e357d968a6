"""The reference model of a board with its operations on rows in C++, for images of full size."""

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, compile_library
from cubestack.emulator.rtl.devboard.lines import lines_of
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.devboard import Response, Status
from cubestack.firmware_model.interface.devboard.outputs import room
from cubestack.hdl.flow.generate import design_hash
from tests.hdl.harness.devboard_model import DevboardModel

from .boards import CompiledDesign

_SOURCE = Path(__file__).with_suffix(".cpp")


class _Port(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int32) for name in ("pin", "offset", "width")]


_PINS = ("address", "data_out", "drives", "ce_n", "oe_n", "we_n")


class _Memory(ctypes.Structure):
    _fields_ = [*((name, _Port) for name in _PINS), ("data_in", ctypes.c_int32)]


_Word = ctypes.c_uint64 * 2


class _Setup(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("handle", "set", "get")),
        ("outputs", _Port * 40),
        ("memories", _Memory * 2),
        ("data", _Port),
        *((name, ctypes.c_int32) for name in ("output_count", "memory_count", "size", "room")),
        ("values", _Word),
        ("acknowledges", _Word),
    ]


class _State(ctypes.Structure):
    _fields_ = [
        ("now", _Word),
        ("after", _Word * 2),
        ("done", ctypes.c_int64),
        ("length", ctypes.c_int64),
        ("records", ctypes.c_uint8 * 1024),
    ]


def _build(compiler: Compiler, scratch: Path, log: Path) -> Path:
    return compile_library(compiler, scratch / "library.so", log, [_SOURCE])


def _word(number: int) -> Any:
    return _Word(number & (1 << 64) - 1, number >> 64)


def _number(word: Any) -> int:
    return int(word[0]) | int(word[1]) << 64


class QuickBoard(DevboardModel):
    """A board of any wiring with up to two memories."""

    design: CompiledDesign

    def __init__(self, wiring: Wiring, name: str = "top") -> None:
        identity = bytes.fromhex(design_hash(wiring.component))[:8]
        lines = lines_of(wiring)
        design = CompiledDesign(wiring)
        super().__init__(wiring.component.pins, lines, design, name=name, design_hash=identity)
        driver = design.engine.driver
        assert driver is not None
        self._pins = driver.pins
        recipe = cache.recipe("a board for tests", "", [_SOURCE], _build)
        self._library = ctypes.CDLL(str(cache.library_of(recipe, None)))
        ports = {name: self._port(name) for name in self.outputs.ports}
        memories = [
            _Memory(*(ports[getattr(own, pin)] for pin in _PINS), self._pins[own.data_in])
            for own in lines.memories
        ]
        self._setup = _Setup(driver.handle, driver.set, driver.get)
        self._setup.outputs[: len(ports)] = list(ports.values())
        self._setup.memories[: len(memories)] = memories
        self._setup.data = ports[lines.data]
        self._setup.output_count, self._setup.memory_count = len(ports), len(memories)
        self._setup.size, self._setup.room = self.outputs.size, room(self.outputs.size)
        values = {lines.data} | {m.address for m in lines.memories}
        self._setup.values = _word(self._mask(values | {m.data_out for m in lines.memories}))
        self._setup.acknowledges = _word(self._mask(set(lines.acknowledges)))

    def _port(self, name: str) -> _Port:
        return _Port(self._pins[name], self.outputs.offsets[name], self.outputs.ports[name].width)

    def _mask(self, names: set[str]) -> int:
        return sum(self.outputs.put(0, name, -1) for name in names)

    def _native(self, act: Any, *arguments: Any) -> Response:
        known = self._known
        state = _State(_word(known.now), (_Word * 2)(*map(_word, known.after)), 0, 0)
        status = Status(act(ctypes.byref(self._setup), ctypes.byref(state), *arguments))
        known.now, known.after = _number(state.now), [_number(word) for word in state.after]
        for name in self.inputs.ports:
            self._levels = self.inputs.put(self._levels, name, self.design.get(name))
        self._staged = self._levels
        return Response(status, state.done, bytes(state.records[: state.length]))

    def _clocks(self, camera: int, memory: int, line: int, pixels: Sequence[int]) -> Response:
        ports = self.lines.cameras[camera]
        pins = [self._pins[name] for name in (ports.clock, ports.data, ports.line)]
        content = bytes(pixels)
        return self._native(
            self._library.board_clocks,
            *pins,
            memory,
            line & 1,
            content,
            ctypes.c_int64(len(content)),
        )

    def _read(self, data: bytes, memory: int, step: int) -> Response:
        clock = self._pins[self.lines.data_clock]
        count = ctypes.c_int64(len(data))
        return self._native(self._library.board_read, clock, memory, step, data, count)
