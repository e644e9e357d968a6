"""The core and its system with plain memory, controlled from Python (system_bench.cpp)."""

import ctypes
from functools import lru_cache, partial
from pathlib import Path

from cubestack.emulator.iss.binding import FOLDER, LOOP
from cubestack.emulator.iss.insight.fault_report import FaultRecord
from cubestack.emulator.iss.machine import REGISTERS as CORE
from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, compile_library

from .thumb import Program

LOG = 0x4000_1000
LINES = 0x4000_2000
RAM = 0x2000_0000

LINE_HIGH, LINE_LOW, PULSE, NMI = range(4)
"""Kinds of events."""

REGISTERS = {
    name: number
    for number, name in enumerate((*CORE, "sleep", "locked", "priority", "resets", "debug_stop"))
}

SYSTEM = {
    **{name: 0xE000_ED04 + 4 * n for n, name in enumerate((
        "ICSR", "VTOR", "AIRCR", "SCR", "CCR", "SHPR1", "SHPR2", "SHPR3", "SHCSR", "CFSR", "HFSR",
        "DFSR", "MMFAR", "BFAR",
    ))},
    **{name: 0xE000_E100 + 0x80 * n for n, name in enumerate((
        "ISER", "ICER", "ISPR", "ICPR", "IABR"
    ))},
    "IPR": 0xE000_E400, "ACTLR": 0xE000_E008, "SYSTICK": 0xE000_E010, "DHCSR": 0xE000_EDF0,
    "DCRDR": 0xE000_EDF8, "DEMCR": 0xE000_EDFC, "STIR": 0xE000_EF00, "MPU": 0xE000_ED90,
    "DWT": 0xE000_1000, "CYCCNT": 0xE000_1004, "EXCCNT": 0xE000_100C, "ITM": 0xE000_0000,
}  # fmt: skip
"""Registers of the private peripheral bus."""

STOP, SLEEP, LOCKUP = 2, 4, 8
"""Bits of the result of a run."""


class Entry(ctypes.Structure):
    """A value that the program wrote to the log."""

    _fields_ = (
        ("cycle", ctypes.c_int64),
        ("value", ctypes.c_uint32),
        ("exception", ctypes.c_uint32),
    )


_P, _I, _U, _L = ctypes.c_void_p, ctypes.c_int32, ctypes.c_uint32, ctypes.c_int64
_FUNCTIONS = {
    "new": (_P, (_I, _I, _L, _L)), "delete": (None, (_P,)), "reset": (None, (_P, _I)),
    "code": (_P, (_P,)), "ram": (_P, (_P,)), "run": (_U, (_P, _L)), "at": (None, (_P, _L, _I, _I)),
    "get": (_U, (_P, _I)), "set": (None, (_P, _I, _U)), "cycles": (_L, (_P,)),
    "set_cycles": (None, (_P, _L)), "next_cycle": (_L, (_P,)), "service": (None, (_P,)),
    "return": (None, (_P, _U)), "line": (None, (_P, _I, _I)), "debugger": (None, (_P, _I, _U)),
    "read": (_I, (_P, _U, _I, ctypes.POINTER(_U))), "write": (_I, (_P, _U, _I, _U)),
    "peek": (_U, (_P, _U)), "log": (_I, (_P, _P, _I)), "text": (ctypes.c_char_p, (_P,)),
    "fault": (None, (_P, _P)),
}  # fmt: skip
"""Result and argument types of system_bench.cpp."""


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    here = Path(__file__).parent / "system_bench.cpp"
    core = sorted((FOLDER / "armv7m").rglob("*.cpp"))
    files = [here, *core, *sorted((FOLDER / "armv7m").rglob("*.h"))]

    def build(sources: list[Path], compiler: Compiler, scratch: Path, log: Path) -> Path:
        unity = scratch / "bench.cpp"
        unity.write_text("".join(f'#include "{file}"\n' for file in sources if file != LOOP))
        return compile_library(compiler, scratch / "bench.so", log, [f"-I{FOLDER}", unity, LOOP])

    recipe = cache.recipe("the core's bench", "bench", files, partial(build, [*core, here]))
    library = ctypes.CDLL(str(cache.library_of(recipe)))
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(library, f"bench_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class Bench:
    """A processor. Memory in ``code`` and ``ram``; items are registers of REGISTERS and SYSTEM.

    ``labels`` are those of the program, a text as for thumb.py.
    """

    def __init__(
        self,
        program: str | Program = "",
        interrupts: int = 39,
        priority_bits: int = 3,
        reference: tuple[int, int] = (0, 1),
    ) -> None:
        self._library = _library()
        self._bench = self._library.bench_new(interrupts, priority_bits, *reference)
        memory = ctypes.c_uint8 * (1 << 16)
        self.code = memory.from_address(self._library.bench_code(self._bench))
        self.ram = memory.from_address(self._library.bench_ram(self._bench))
        if isinstance(program, str):
            program = Program(program)
        self.labels = program.labels
        self.code[: len(program.image)] = list(program.image)
        self.reset()

    def __del__(self) -> None:
        if hasattr(self, "_bench"):
            self._library.bench_delete(self._bench)

    def __getitem__(self, name: str) -> int:
        if name in SYSTEM:
            value = self.read(SYSTEM[name])
            assert value is not None
            return value
        return self._library.bench_get(self._bench, REGISTERS[name])

    def __setitem__(self, name: str, value: int) -> None:
        if name in SYSTEM:
            assert self.write(SYSTEM[name], value)
        else:
            self._library.bench_set(self._bench, REGISTERS[name], value)

    @property
    def ipsr(self) -> int:
        """Number of the active exception."""
        return self["xpsr"] & 0x1FF

    @property
    def cycles(self) -> int:
        return self._library.bench_cycles(self._bench)

    @cycles.setter
    def cycles(self, value: int) -> None:
        self._library.bench_set_cycles(self._bench, value)

    @property
    def log(self) -> list[Entry]:
        """Values written to ``LOG``."""
        entries = (Entry * 4096)()
        return entries[: self._library.bench_log(self._bench, entries, 4096)]

    @property
    def text(self) -> str:
        """Writes to the ITM as ``<port:value/bytes>``."""
        return self._library.bench_text(self._bench).decode()

    @property
    def fault(self) -> FaultRecord:
        record = FaultRecord()
        self._library.bench_fault(self._bench, ctypes.byref(record))
        return record

    def reset(self, power_on: bool = True) -> None:
        """Start from the vector table; also discards decoded code."""
        self._library.bench_reset(self._bench, power_on)

    def run(self, cycles: int) -> int:
        """Run for a number of cycles or until a stop; returns the reasons as bits."""
        return self._library.bench_run(self._bench, self.cycles + cycles)

    def at(self, cycle: int, kind: int, number: int = 0) -> None:
        """Schedule an event."""
        self._library.bench_at(self._bench, cycle, kind, number)

    def line(self, number: int, level: bool) -> None:
        self._library.bench_line(self._bench, number, level)

    def service(self) -> None:
        """Do what the instruction loop does between two instructions."""
        self._library.bench_service(self._bench)

    def exception_return(self, value: int) -> None:
        """Branch to an EXC_RETURN value."""
        self._library.bench_return(self._bench, value)

    def debugger(self, catches: int) -> None:
        """Attach a halting debugger."""
        self._library.bench_debugger(self._bench, 1, catches)

    @property
    def next_cycle(self) -> int:
        """Cycle at which SysTick pends its exception."""
        return self._library.bench_next_cycle(self._bench)

    def read(self, address: int, size: int = 4) -> int | None:
        """Read the private peripheral bus; None is a bus error."""
        value = ctypes.c_uint32()
        done = self._library.bench_read(self._bench, address, size, value)
        return value.value if done else None

    def write(self, address: int, value: int, size: int = 4) -> bool:
        """Write the private peripheral bus; False is a bus error."""
        return bool(self._library.bench_write(self._bench, address, size, value))

    def peek(self, address: int) -> int:
        """Read as a debugger does."""
        return self._library.bench_peek(self._bench, address)

    def word(self, address: int) -> int:
        """Read a word of RAM."""
        offset = address - RAM
        return int.from_bytes(bytes(self.ram[offset : offset + 4]), "little")
