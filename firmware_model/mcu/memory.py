"""Memories of a processor: the buffers of a program in each, and the pages of the flash."""

from dataclasses import dataclass, field
from enum import Enum
from itertools import zip_longest


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


@dataclass(eq=False)
class FlashStore:
    """Flash pages by name, which survive power cycles, and the number of writes of each."""

    pages: dict[str, bytes] = field(default_factory=dict)
    writes: dict[str, int] = field(default_factory=dict)

    def write(self, page: str, data: bytes, endurance: int | None = None) -> None:
        """Erase and program ``page``; after ``endurance`` writes its zeros remain."""
        if endurance is not None and self.writes.get(page, 0) >= endurance:
            worn = self.pages.get(page, b"")
            data = bytes(old & new for old, new in zip_longest(worn, data, fillvalue=0xFF))
        self.pages[page] = bytes(data)
        self.writes[page] = self.writes.get(page, 0) + 1

    def erase(self, page: str) -> None:
        self.pages.pop(page, None)

    def read(self, page: str) -> bytes | None:
        """Contents of ``page``, or None if it is erased."""
        return self.pages.get(page)
