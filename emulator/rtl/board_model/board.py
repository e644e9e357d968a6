"""Builds simulated boards, and sends bytes to them."""

import ctypes
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, compile_library
from cubestack.hdl.flow.generate import cxxrtl_headers, yosys_version

_FOLDER = Path(__file__).parent
_SOURCES = [_FOLDER / "driver.cpp", _FOLDER / "lanes.h"]
_ROOM = 1 << 14  # bytes received by one call
_STEP = 10_000  # clocks of one call

#: Clocks after which a board that is not idle is given up.
PATIENCE = 50_000_000


class BoardHangsError(RuntimeError):
    """A simulated board did not become idle."""


class _Lane(ctypes.Structure):
    """As in driver.cpp."""

    _fields_ = (
        ("bytes", ctypes.c_char_p),
        ("count", ctypes.c_int64),
        ("received", ctypes.POINTER(ctypes.c_char)),
        ("room", ctypes.c_int64),
        ("sent", ctypes.c_int64),
        ("found", ctypes.c_int64),
        ("clocks", ctypes.c_int64),
        ("busy", ctypes.c_int32),
    )


def _compile(header: str, further: str, compiler: Compiler, scratch: Path, log: Path) -> Path:
    (scratch / "board.h").write_text(header)
    (scratch / "design.cpp").write_text(further)
    folders = f"-I{scratch}", f"-I{_FOLDER}", f"-I{cxxrtl_headers()}"
    return compile_library(compiler, scratch / "library.so", log, [*folders, _SOURCES[0]])


class SimulatedBoards:
    """The boards' ends of serial lines, side by side, as fast as the simulation runs.

    Attributes:
        divider: clocks per bit, as the boards were built.
        most: number of boards that a header allows.
    """

    def __init__(self, header: str, divider: int, *, design: str = "", count: int = 1) -> None:
        """``header`` declares struct Board in C++ (see driver.cpp); it may include ``design``.

        Raises:
            CompilerError: there is no C++ compiler, or it failed.
            ValueError: ``count`` is more than a header allows.
        """
        self.divider = divider
        self._handle: Any = None
        tools = (yosys_version().encode(),)
        build = partial(_compile, header, design)
        recipe = cache.recipe("a simulated board", header + design, _SOURCES, build, tools)
        self._library = ctypes.CDLL(str(cache.library_of(recipe, None)))
        self._library.board_new.restype = ctypes.c_void_p
        self._library.board_new.argtypes = [ctypes.c_int32]
        self._library.board_delete.argtypes = [ctypes.c_void_p]
        self._library.board_run.restype = None
        self._library.board_run.argtypes = [
            *(ctypes.c_void_p, ctypes.POINTER(_Lane), ctypes.c_int32, ctypes.c_int64)
        ]
        self.most = int(self._library.board_lanes())
        if not 1 <= count <= self.most:
            raise ValueError(f"{count} boards can not run side by side, 1 to {self.most} can")
        self._handle = self._library.board_new(divider)
        self._lanes = (_Lane * count)()
        self._received = [ctypes.create_string_buffer(_ROOM) for _ in range(count)]
        for lane, buffer in zip(self._lanes, self._received, strict=True):
            lane.received, lane.room = buffer, _ROOM

    def __len__(self) -> int:
        return len(self._lanes)

    def close(self) -> None:
        if self._handle is not None:
            self._library.board_delete(self._handle)
            self._handle = None

    def clocks(self, board: int) -> int:
        """Clocks simulated so far, but those of an idle board."""
        return int(self._lanes[board].clocks)

    def idle(self, board: int) -> bool:
        """Whether it has nothing to do until a byte comes."""
        return not self._lanes[board].busy

    def run(self, waiting: Sequence[bytearray]) -> list[bytes]:
        """Send bytes without pauses until a busy board becomes idle, at most for a while.

        Args:
            waiting: bytes to each board; those that were sent are removed.

        Returns:
            What each board has sent.
        """
        for lane, data in zip(self._lanes, waiting, strict=True):
            part = bytes(data[:_ROOM])
            lane.bytes, lane.count = part, len(part)
        self._library.board_run(self._handle, self._lanes, len(self._lanes), _STEP)
        for lane, data in zip(self._lanes, waiting, strict=True):
            del data[: lane.sent]
        return [
            buffer.raw[: lane.found]
            for lane, buffer in zip(self._lanes, self._received, strict=True)
        ]


class SimulatedBoard(SimulatedBoards):
    """One board that answers at once."""

    def receive(self, data: bytes) -> bytes:
        """Send bytes without pauses; returns what the board sends until it is idle.

        Raises BoardHangsError after PATIENCE clocks.
        """
        answer, waiting = b"", bytearray(data)
        end = self.clocks(0) + PATIENCE
        while True:
            (received,) = self.run([waiting])
            answer += received
            if self.idle(0) and not waiting:
                return answer
            if self.clocks(0) >= end:
                raise BoardHangsError(f"the board is not idle after {PATIENCE} clocks")
