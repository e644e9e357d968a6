"""Where everything lies, and whether it fits: the memories of the PIC18F45K20 on CubeSense.

CubeSense thesis, appendix A.7 (1536 bytes of RAM, 32 kB of flash) and section 6.2 (pages of 256
bytes, constant tables in flash). Sizes are derived from the constants that the program uses.
Program code is not modelled, so flash must leave room for it.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from cubestack.firmware_model.cubesense.distortion import TABLE_ENTRIES
from cubestack.firmware_model.cubesense.edges import MAX_EDGES
from cubestack.firmware_model.cubesense.sun_centroid import window_bytes
from cubestack.firmware_model.interface.cubesense_codes import FRAME_BYTES, MASK_AREAS, Camera
from cubestack.firmware_model.interface.cubesense_fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense_telecommands import (
    DISTORTION_TERMS,
    TELECOMMANDS,
)

__all__ = ["CAPACITY", "COMMAND_QUEUE", "Buffer", "Memory", "budget", "used"]

COMMAND_QUEUE = 4
"""Telecommands that wait, as the node protocol's hosts expect."""

INT, FLOAT = 2, 4

STACK_BYTES = 256
"""Software stack, one page: assumed, as C18 sets it up."""

STATE_BYTES = 96
"""Results, settings, counters, flags and task state: assumed."""


class Memory(Enum):
    """A memory of the part."""

    RAM = "RAM"
    FLASH = "flash"


#: Size of each memory in bytes.
CAPACITY = {Memory.RAM: 1536, Memory.FLASH: 32 * 1024}


@dataclass(frozen=True)
class Buffer:
    """One buffer: its name, where it lies, its size in bytes."""

    name: str
    memory: Memory
    size: int


def budget() -> tuple[Buffer, ...]:
    """Every buffer of the program."""
    longest = 1 + max(message.length for message in TELECOMMANDS)
    ram = {
        "scanned pixels": FULL_SIZE.scan_step,
        "samples of the row above": len(FULL_SIZE.scan_columns),
        "edges": MAX_EDGES * 2 * INT,
        "edges, undistorted": MAX_EDGES * 2 * INT,
        "normal equations, their inverse, right side": (9 + 9 + 3) * FLOAT,
        "Sun window": window_bytes(),
        "sums of the window's columns and of a row": (FULL_SIZE.window + 1) * (FLOAT + INT),
        "telecommands, waiting and being received": (COMMAND_QUEUE + 1) * longest,
        "image frame, also the answer being sent": FRAME_BYTES,
        "masks": len(Camera) * MASK_AREAS * 4 * INT,
        "results, settings, counters, flags": STATE_BYTES,
        "software stack": STACK_BYTES,
    }
    coefficients = len(Camera) * DISTORTION_TERMS * FLOAT
    flash = {
        "distortion tables": len(Camera) * TABLE_ENTRIES * np.dtype(np.int16).itemsize,
        "published distortion table": TABLE_ENTRIES,
        "distortion coefficients": coefficients,
    }
    return (
        *(Buffer(name, Memory.RAM, size) for name, size in ram.items()),
        *(Buffer(name, Memory.FLASH, size) for name, size in flash.items()),
    )


def used(buffers: tuple[Buffer, ...]) -> dict[Memory, int]:
    """Bytes in use of each memory."""
    return {
        memory: sum(buffer.size for buffer in buffers if buffer.memory is memory)
        for memory in Memory
    }
