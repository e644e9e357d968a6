"""Buffers of a program by memory, and the bytes that they use."""

from dataclasses import dataclass
from enum import Enum


class Memory(Enum):
    """A memory of a processor board."""

    RAM = "RAM"
    FLASH = "flash"
    EXTERNAL_RAM = "external SRAM"
    RETENTION = "retention registers"


@dataclass(frozen=True)
class Buffer:
    """One buffer of ``size`` bytes, which may lie ``inside`` the buffer of that name."""

    name: str
    memory: Memory
    size: int
    inside: str = ""


def used(buffers: tuple[Buffer, ...]) -> dict[Memory, int]:
    memories = {buffer.memory for buffer in buffers}
    return {
        memory: sum(b.size for b in buffers if b.memory is memory and not b.inside)
        for memory in Memory
        if memory in memories
    }
