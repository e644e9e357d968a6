"""Programs for a machine: ELF, Intel HEX, or bytes with a base address."""

from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path


class ImageError(ValueError):
    """A file is no program for this machine; one line says why."""


@dataclass(frozen=True)
class Image:
    """A program.

    Attributes:
        segments: (address, bytes) that go into memory, by address.
        path: of the file; None for one that was made here.
        elf: the file's bytes where it is an ELF file, for symbols.
        hash: SHA-256 of what goes into memory, in hexadecimal.
    """

    segments: tuple[tuple[int, bytes], ...]
    path: Path | None = None
    elf: bytes | None = None
    hash: str = field(init=False)

    def __post_init__(self) -> None:
        """Compute the hash."""
        digest = sha256()
        for address, data in self.segments:
            digest.update(address.to_bytes(8, "little") + len(data).to_bytes(8, "little") + data)
        object.__setattr__(self, "hash", digest.hexdigest())
