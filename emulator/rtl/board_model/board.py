"""Builds a simulated board, and sends bytes to it."""

import ctypes
from functools import partial
from pathlib import Path

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, compile_library
from cubestack.hdl.flow.generate import cxxrtl_headers, yosys_version

_FOLDER = Path(__file__).parent
_ROOM = 1 << 16  # bytes received by one call

#: Clocks after which a board that is not idle is given up.
PATIENCE = 50_000_000


class BoardHangsError(RuntimeError):
    """A simulated board did not become idle."""


def _compile(header: str, further: str, compiler: Compiler, scratch: Path, log: Path) -> Path:
    (scratch / "board.h").write_text(header)
    (scratch / "design.cpp").write_text(further)
    folders = f"-I{scratch}", f"-I{cxxrtl_headers()}"
    source = _FOLDER / "driver.cpp"
    return compile_library(compiler, scratch / "library.so", log, [*folders, source])


class SimulatedBoard:
    """The board's end of a serial line, as fast as the simulation runs.

    Attributes:
        divider: clocks per bit, as the board was built.
    """

    def __init__(self, header: str, divider: int, *, design: str = "") -> None:
        """``header`` declares struct Board in C++ (see driver.cpp); it may include ``design``.

        Raises:
            CompilerError: there is no C++ compiler, or it failed.
        """
        self.divider = divider
        tools = (yosys_version().encode(),)
        build = partial(_compile, header, design)
        sources = [_FOLDER / "driver.cpp"]
        recipe = cache.recipe("a simulated board", header + design, sources, build, tools)
        self._library = ctypes.CDLL(str(cache.library_of(recipe, None)))
        self._library.board_new.restype = ctypes.c_void_p
        self._library.board_new.argtypes = [ctypes.c_int32]
        self._library.board_delete.argtypes = [ctypes.c_void_p]
        self._library.board_clocks.argtypes = [ctypes.c_void_p]
        self._library.board_clocks.restype = ctypes.c_int64
        run = self._library.board_run
        run.restype = ctypes.c_int64
        run.argtypes = [
            ctypes.c_void_p,
            ctypes.c_char_p,
            ctypes.c_int64,
            ctypes.c_char_p,
            ctypes.c_int64,
            ctypes.c_int64,
            ctypes.POINTER(ctypes.c_int64),
        ]
        self._handle = self._library.board_new(divider)
        self._received = ctypes.create_string_buffer(_ROOM)

    def close(self) -> None:
        if self._handle is not None:
            self._library.board_delete(self._handle)
            self._handle = None

    @property
    def clocks(self) -> int:
        """Clocks simulated so far."""
        return int(self._library.board_clocks(self._handle))

    def receive(self, data: bytes) -> bytes:
        """Send bytes without pauses; returns what the board sends until it is idle.

        Raises BoardHangsError after PATIENCE clocks.
        """
        answer, sent = b"", ctypes.c_int64()
        end = self.clocks + PATIENCE
        while True:
            arguments = data, len(data), self._received, _ROOM, end - self.clocks, sent
            count = self._library.board_run(self._handle, *arguments)
            answer += self._received.raw[:count]
            data = data[sent.value :]
            if count < _ROOM and self.clocks >= end:
                raise BoardHangsError(f"the board is not idle after {PATIENCE} clocks")
            if count < _ROOM and not data:
                return answer
