"""Programs for a machine: ELF, Intel HEX, S-records, UF2, or raw bytes with a base address."""

import re
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

from cubestack.emulator.iss import image_formats
from cubestack.emulator.iss.file_kind import kind_of_file
from cubestack.emulator.iss.image_formats import FormatError
from cubestack.firmware_model.formats.untrusted import LARGEST_IMAGE, read_bytes, shown

LONGEST_REASON = 300
"""Characters of an error that may quote the file."""

VECTORS = 8
"""Bytes of the vector table that are checked: stack pointer and reset vector."""

_BASE = re.compile(r"(.+)@(0[xX][0-9a-fA-F]+|\d+)")
_HASH = re.compile(r"(.+)#([0-9a-f]{8,64})")


class ImageError(ValueError):
    """The file is not a program for this machine; the message is one line."""


@dataclass(frozen=True)
class Memory:
    """Address ranges of a machine: what a program may fill, and where its stack may be."""

    flash_base: int = 0
    flash_bytes: int = 1 << 20
    #: user data page and lock bits: written with the flash, EFM32GG Reference Manual, 7.3.2
    pages: tuple[int, ...] = (0x0FE0_0000, 0x0FE0_4000)
    page_bytes: int = 4096
    #: RAM for data and for code, external bus: start and bytes
    stacks: tuple[tuple[int, int], ...] = (
        (0x2000_0000, 128 << 10), (0x1000_0000, 128 << 10), (0x8000_0000, 1 << 28),
        (0x1200_0000, 1 << 26),
    )  # fmt: skip

    def holds(self, address: int, count: int) -> bool:
        """Whether all these bytes are in the flash, or in one of its pages of information."""
        ranges = (self.flash_base, self.flash_bytes), *((at, self.page_bytes) for at in self.pages)
        return any(start <= address and address + count <= start + size for start, size in ranges)

    def holds_stack(self, top: int) -> bool:
        return any(start < top <= start + size for start, size in self.stacks)


@dataclass(frozen=True)
class Image:
    """A program."""

    segments: tuple[tuple[int, bytes], ...]  #: (address, bytes) for the flash, sorted by address
    path: Path | None = None  #: of the file; None if it is not from a file
    #: contents of the file if it is an ELF file, for symbols
    elf: bytes | None = field(default=None, repr=False)
    hash: str = field(init=False)  #: SHA-256 of the segments, in hexadecimal

    def __post_init__(self) -> None:
        digest = sha256()
        for address, data in self.segments:
            digest.update(address.to_bytes(8, "little") + len(data).to_bytes(8, "little") + data)
        object.__setattr__(self, "hash", digest.hexdigest())

    @property
    def mark(self) -> str:
        """Suffix for a file name with which ``load_image`` checks that it is this program."""
        return f"#{self.hash[:16]}"

    @property
    def size(self) -> int:
        return sum(len(data) for _, data in self.segments)


def load_image(name: str | Path, memory: Memory | None = None, base: int | None = None) -> Image:
    """Read a program, whose format shows in its contents.

    Args:
        name: path; an optional ``#HASH`` is compared with the start of the program's hash.
        memory: of the machine.
        base: address of raw bytes, which ``FILE@0xADDRESS`` states, too; without one they are
            rejected.

    Raises:
        ImageError: the file cannot be read, or is not a program for the machine.
    """
    memory = memory or Memory()
    text, wanted = str(name), ""
    if (match := _HASH.fullmatch(text)) and not Path(text).exists():
        text, wanted = match[1], match[2]
    path, stated = _split(text)
    base = stated if base is None else base
    try:
        data = read_bytes(path, LARGEST_IMAGE, ImageError)
    except OSError as error:
        raise ImageError(f"{path}: {error.strerror}") from None
    if not data:
        raise ImageError(f"{path} is empty")
    read = image_formats.format_of(data)
    if read is None:
        image = Image(((_base_of(path, data, base), data),), path)
    elif base is not None:
        raise ImageError(f"{path} has its own addresses; only raw bytes take a base")
    else:
        try:
            segments = read(data)
        except FormatError as error:
            between = ", " if str(error).startswith(("line", "block")) else " "
            raise ImageError(f"{path}{between}{shown(str(error))[:LONGEST_REASON]}") from None
        image = Image(segments, path, data if read is image_formats.elf_segments else None)
    check_image(image, memory)
    if not image.hash.startswith(wanted):
        raise ImageError(f"{path} has the hash {image.hash[:16]}, not the requested {wanted}")
    return image


SUFFIXES = {
    "an ELF file": (".elf", ".axf", ".out"),
    "an Intel HEX file": (".hex", ".ihx", ".ihex"),
    "a file of S-records": (".srec", ".mot", ".s19", ".s28", ".s37"),
    "a UF2 file": (".uf2",),
}


def _base_of(path: Path, data: bytes, base: int | None) -> int:
    """The address of raw bytes; ImageError for files that are none, or without one."""
    for kind, suffixes in SUFFIXES.items():
        if path.suffix.lower() in suffixes:
            raise ImageError(f"{path} is not {kind}: it begins with {data[:4]!r}")
    if base is None:
        raise ImageError(
            f"{path} is {kind_of_file(path, data)}; expected ELF, Intel HEX, S-records or UF2, or "
            "raw bytes with --firmware-base ADDRESS"
        )
    return base


def check_image(image: Image, memory: Memory) -> None:
    """Raise ImageError for a program that does not fit or has no plausible vector table."""
    name = image.path or "the image"
    for address, data in image.segments:
        if not memory.holds(address, len(data)):
            last, end = address + len(data) - 1, memory.flash_base + memory.flash_bytes - 1
            raise ImageError(
                f"{name} has bytes at {address:#010x}..{last:#010x}, beyond the flash "
                f"{memory.flash_base:#010x}..{end:#010x}"
            )
    vectors = _bytes_at(image, memory.flash_base, VECTORS)
    if vectors is None:
        raise ImageError(f"{name} has no vector table at {memory.flash_base:#010x}")
    stack, start = (int.from_bytes(vectors[n : n + 4], "little") for n in (0, 4))
    found = f"{name} has no vector table: stack pointer {stack:#010x}, reset vector {start:#010x}"
    if not memory.holds_stack(stack):
        raise ImageError(f"{found}; the stack is not in RAM")
    if not start & 1 or _bytes_at(image, start & ~1, 2) is None:
        raise ImageError(f"{found}; the latter is not the address of Thumb code in the program")


def _bytes_at(image: Image, address: int, count: int) -> bytes | None:
    """Bytes of the image, 0xFF where it has none; None if it has none of them."""
    found = bytearray(b"\xff" * count)
    any_there = False
    for start, data in image.segments:
        for at in range(max(start, address), min(start + len(data), address + count)):
            found[at - address] = data[at - start]
            any_there = True
    return bytes(found) if any_there else None


def _split(name: str) -> tuple[Path, int | None]:
    match = _BASE.fullmatch(name)
    if match is None or Path(name).exists():
        return Path(name), None
    return Path(match[1]), int(match[2], 0)
