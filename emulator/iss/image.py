"""Programs for a machine: ELF, Intel HEX, or bytes with a base address.

ELF for the Arm architecture (IHI 0044); Intel Hexadecimal Object File Format, revision A.
"""

import re
from dataclasses import dataclass, field
from hashlib import sha256
from io import BytesIO
from pathlib import Path

from elftools.elf.elffile import ELFFile

VECTORS = 8
"""Bytes of the vector table that are checked: stack pointer and reset vector."""

_BASE = re.compile(r"(.+)@(0[xX][0-9a-fA-F]+|\d+)")
_HASH = re.compile(r"(.+)#([0-9a-f]{8,64})")


class ImageError(ValueError):
    """The file is not a program for this machine; the message is one line."""


@dataclass(frozen=True)
class Memory:
    """Address ranges of a machine."""

    flash_base: int = 0
    flash_bytes: int = 1 << 20
    ram_base: int = 0x2000_0000
    ram_bytes: int = 128 << 10

    def holds(self, address: int, count: int) -> bool:
        """Whether all these bytes are in the flash."""
        start = address - self.flash_base
        return start >= 0 and start + count <= self.flash_bytes


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


def load_image(name: str | Path, memory: Memory | None = None) -> Image:
    """Read a program: ELF, Intel HEX (``.hex``, ``.ihx``), or any other file as plain bytes.

    Args:
        name: path; ``FILE@0xADDRESS`` sets the address of plain bytes, by default the start of the
            flash; an optional ``#HASH`` is compared with the start of the program's hash.
        memory: of the machine.

    Raises:
        ImageError: the file cannot be read, or is not a program for the machine.
    """
    memory = memory or Memory()
    text, wanted = str(name), ""
    if (match := _HASH.fullmatch(text)) and not Path(text).exists():
        text, wanted = match[1], match[2]
    path, base = _split(text, memory)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: {error.strerror}") from None
    if not data:
        raise ImageError(f"{path} is empty")
    if data.startswith(b"\x7fELF"):
        image = Image(_elf_segments(path, data), path, data)
    elif data.lstrip().startswith(b":") and path.suffix.lower() in (".hex", ".ihx", ".ihex"):
        image = Image(_hex_segments(path, data), path)
    elif path.suffix.lower() in (".elf", ".axf", ".out"):
        raise ImageError(f"{path} is not an ELF file: it begins with {data[:4]!r}")
    elif path.suffix.lower() in (".hex", ".ihx", ".ihex"):
        raise ImageError(f"{path} is not an Intel HEX file: its first record has no colon")
    else:
        image = Image(((base, data),), path)
    check_image(image, memory)
    if not image.hash.startswith(wanted):
        raise ImageError(f"{path} has the hash {image.hash[:16]}, not the requested {wanted}")
    return image


def check_image(image: Image, memory: Memory) -> None:
    """Raise ImageError for a program that does not fit or has no vector table."""
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
    if stack in (0, 0xFFFF_FFFF) and start in (0, 0xFFFF_FFFF):
        raise ImageError(
            f"{name} has no vector table: stack pointer {stack:#010x}, reset vector {start:#010x}"
        )


def _bytes_at(image: Image, address: int, count: int) -> bytes | None:
    """Bytes of the image, 0xFF where it has none; None if it has none of them."""
    found = bytearray(b"\xff" * count)
    any_there = False
    for start, data in image.segments:
        for at in range(max(start, address), min(start + len(data), address + count)):
            found[at - address] = data[at - start]
            any_there = True
    return bytes(found) if any_there else None


def _split(name: str, memory: Memory) -> tuple[Path, int]:
    match = _BASE.fullmatch(name)
    if match is None or Path(name).exists():
        return Path(name), memory.flash_base
    return Path(match[1]), int(match[2], 0)


def _elf_segments(path: Path, data: bytes) -> tuple[tuple[int, bytes], ...]:
    try:
        file = ELFFile(BytesIO(data))
        header = file.header
        if file.get_machine_arch() != "ARM" or file.elfclass != 32:
            raise ImageError(
                f"{path} is for {file.get_machine_arch()} with {file.elfclass} bits, "
                "not for ARM with 32"
            )
        if not file.little_endian:
            raise ImageError(f"{path} is big-endian: the core is little-endian")
        if header["e_type"] != "ET_EXEC":
            raise ImageError(f"{path} is not an executable, but {header['e_type']}")
        segments = [
            (int(segment["p_paddr"]), bytes(segment.data()))
            for segment in file.iter_segments("PT_LOAD")
            if segment["p_filesz"]
        ]
    except ImageError:
        raise
    except Exception as error:  # elftools raises various exceptions for damaged files
        raise ImageError(f"{path} is a damaged ELF file: {error or type(error).__name__}") from None
    if not segments:
        raise ImageError(f"{path} has nothing to load: no segment with bytes")
    return tuple(sorted(segments))


def _hex_segments(path: Path, text: bytes) -> tuple[tuple[int, bytes], ...]:
    segments: list[tuple[int, bytearray]] = []
    base = 0
    for number, line in enumerate(text.decode("latin-1").splitlines(), 1):
        line = line.strip()
        if not line:
            continue
        try:
            record = bytes.fromhex(line[1:])
        except ValueError:
            record = b""
        if line[0] != ":" or len(record) < 5 or len(record) != 5 + record[0]:
            raise ImageError(f"{path}, line {number}: not an Intel HEX record")
        if sum(record) & 0xFF:
            raise ImageError(f"{path}, line {number}: wrong checksum")
        offset, kind, data = int.from_bytes(record[1:3], "big"), record[3], record[4:-1]
        if kind == 0:
            address = base + offset
            if segments and segments[-1][0] + len(segments[-1][1]) == address:
                segments[-1][1].extend(data)
            else:
                segments.append((address, bytearray(data)))
        elif kind == 1:
            break
        elif kind in (2, 4):
            base = int.from_bytes(data, "big") << (4 if kind == 2 else 16)
        elif kind not in (3, 5):  # 3 and 5 are start addresses; the core uses its vector table
            raise ImageError(f"{path}, line {number}: unknown record type {kind:02X}")
    if not segments:
        raise ImageError(f"{path} has no data records")
    return tuple(sorted((address, bytes(data)) for address, data in segments))
