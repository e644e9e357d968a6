"""Connects a debugger to a board that runs a user's own firmware.

Besides the processor's memories GDB sees, at addresses that the part does not use:

==========  ==================================================================================
C0000000    SRAM of the first FPGA; of each further one, 1000000 higher
D0000000    registers of the camera, one byte per address of its control bus
==========  ==================================================================================
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from cubestack.emulator.boards.firmware import Insight
from cubestack.emulator.boards.monitor import FirmwareBoard, Monitor
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.iss.gdb.target import MemoryRegion
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.emulator.sim.debugger import ArrayWindow, Debugger, Window
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor

PAGE_BYTES = 4096
REGIONS = (
    MemoryRegion("flash", 0x0000_0000, 1 << 20, PAGE_BYTES),
    MemoryRegion("rom", 0x0FE0_0000, 0x1_0000),
    MemoryRegion("ram", 0x1000_0000, 128 << 10),
    MemoryRegion("ram", 0x2000_0000, 128 << 10),
    MemoryRegion("ram", 0x2200_0000, 4 << 20),
    MemoryRegion("ram", 0x4000_0000, 0x0400_0000),
    MemoryRegion("ram", 0x8000_0000, 0x1000_0000),
    MemoryRegion("ram", 0xE000_0000, 1 << 20),
)
"""Flash, information pages, RAM, its bit-band alias, peripherals, external bus, core registers.

EFM32GG Reference Manual, chapter 5 (memory and bus system).
"""

FPGA_BASE, FPGA_STEP = 0xC000_0000, 0x0100_0000
CAMERA_BASE = 0xD000_0000
CAMERA_BYTES = 1 << 16

SERVE_S = 0.02
"""Longest wait for the debugger while the kernel is paused."""


@dataclass(frozen=True)
class CameraWindow:
    """Registers of a camera, as memory that the debugger can only read."""

    registers: RegisterFile

    def read(self, offset: int, count: int) -> bytes:
        """The bytes written last; 0 where there is no register."""
        return bytes(self.registers.peek(offset + index) & 0xFF for index in range(count))

    def write(self, offset: int, data: bytes) -> bool:
        """Always False: only the firmware writes to the control bus."""
        return False


class DebuggedBoard(FirmwareBoard, Protocol):
    """A board with a debugger."""

    processor: FirmwareProcessor
    insight: Insight

    def reset_pin(self) -> None: ...


def windows(board: DebuggedBoard) -> Mapping[MemoryRegion, Window]:
    found: dict[MemoryRegion, Window] = {}
    if board.engine is not None:
        for index, memory in enumerate(board.engine.memories.values()):
            start = FPGA_BASE + index * FPGA_STEP
            found[MemoryRegion("ram", start, memory.size)] = ArrayWindow(memory)
    if board.camera is not None:
        registers = CameraWindow(board.camera.registers)
        found[MemoryRegion("rom", CAMERA_BASE, CAMERA_BYTES)] = registers
    return found


def open_debugger(board: DebuggedBoard, port: int, *, wait: bool = False) -> GdbEndpoint:
    """Serve GDB on ``port`` (0: any free one).

    A scheduler of ports may serve the endpoint; otherwise it is served at steps of the kernel. With
    ``wait``, nothing runs until a client resumes the processor. Raises PortError.
    """
    debugger = Debugger(
        board.kernel,
        board.machine,
        board.reset_pin,
        REGIONS,
        windows(board),
        Monitor(board, board.insight.symbols),
    )
    endpoint = GdbEndpoint(port, debugger)
    debugger.poll = endpoint.poll
    debugger.serve = lambda: endpoint.serve(SERVE_S)
    board.processor.debugger = debugger
    if wait:
        debugger.halt()
    endpoint.on_close = debugger.close
    return endpoint
