"""The bytes of a program's file: ELF, Intel HEX, S-records, UF2.

ELF for the Arm architecture (IHI 0044); Intel Hexadecimal Object File Format, revision A; Motorola
S-records (Unix manual, srec(5)); USB Flashing Format (github.com/microsoft/uf2).
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from io import BytesIO
from typing import NamedTuple

from elftools.elf.elffile import ELFFile

Segment = tuple[int, bytes]


class FormatError(ValueError):
    """A damaged or foreign file; the message continues "FILE"."""


def joined(pieces: Iterable[Segment]) -> tuple[Segment, ...]:
    """Segments by address, adjacent pieces joined; FormatError if two overlap."""
    segments: list[tuple[int, bytearray]] = []
    for address, data in sorted(piece for piece in pieces if piece[1]):
        end = segments[-1][0] + len(segments[-1][1]) if segments else -1
        if address < end:
            raise FormatError(f"has two contents for address {address:#010x}")
        if address == end:
            segments[-1][1].extend(data)
        else:
            segments.append((address, bytearray(data)))
    if not segments:
        raise FormatError("has no data records")
    return tuple((address, bytes(data)) for address, data in segments)


# --- ELF ------------------------------------------------------------------------------------------


def elf_segments(data: bytes) -> tuple[Segment, ...]:
    """The loaded segments at their physical addresses, after a check of the whole file."""
    try:
        return _elf_segments(data)
    except FormatError:
        raise
    except Exception as error:  # elftools raises various exceptions for damaged files
        raise FormatError(f"is a damaged ELF file: {error or type(error).__name__}") from None


def _elf_segments(data: bytes) -> tuple[Segment, ...]:
    file = ELFFile(BytesIO(data))
    header = file.header
    if file.get_machine_arch() != "ARM" or file.elfclass != 32:
        raise FormatError(
            f"is for {file.get_machine_arch()} with {file.elfclass} bits, not for ARM with 32"
        )
    if not file.little_endian:
        raise FormatError("is big-endian: the core is little-endian")
    if header["e_type"] != "ET_EXEC":
        raise FormatError(f"is not an executable, but {header['e_type']}")
    for name, mark in (("program", "ph"), ("section", "sh")):
        size = header[f"e_{mark}num"] * header[f"e_{mark}entsize"]
        _inside(data, f"{name} header table", header[f"e_{mark}off"], size)
    for section in file.iter_sections():
        if section["sh_type"] not in ("SHT_NOBITS", "SHT_NULL"):
            _inside(data, f"section {section.name}", section["sh_offset"], section["sh_size"])
    loaded = list(file.iter_segments("PT_LOAD"))
    for number, segment in enumerate(loaded):
        _inside(data, f"segment {number}", segment["p_offset"], segment["p_filesz"])
        if segment["p_filesz"] > segment["p_memsz"]:
            raise FormatError(
                f"is a damaged ELF file: segment {number} has {segment['p_filesz']} bytes for "
                f"{segment['p_memsz']} of memory"
            )
    pieces = [(int(one["p_paddr"]), bytes(one.data())) for one in loaded if one["p_filesz"]]
    if not pieces:
        raise FormatError("has nothing to load: no segment with bytes")
    entry = header["e_entry"]
    if entry and not any(
        one["p_vaddr"] <= entry & ~1 < one["p_vaddr"] + one["p_filesz"] for one in loaded
    ):
        raise FormatError(f"has its entry {entry:#010x} outside of what it loads")
    return joined(pieces)


def _inside(data: bytes, what: str, offset: int, size: int) -> None:
    if size and offset + size > len(data):
        raise FormatError(
            f"is a damaged ELF file: its {what} ends at byte {offset + size}, "
            f"the file at {len(data)}"
        )


# --- records of text ------------------------------------------------------------------------------


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(data.decode("latin-1").splitlines(), 1):
        if line.strip():
            yield number, line.strip()


def _record(line: str, mark: str, header: int) -> bytes:
    """Bytes of a record behind its mark; empty if it is none."""
    try:
        record = bytes.fromhex(line[header:])
    except ValueError:
        return b""
    return record if line.startswith(mark) and "".join(line.split()) == line else b""


HEX_LENGTHS = {1: 0, 2: 2, 3: 4, 4: 2, 5: 4}
"""Bytes of the records that are not data: end, segment and linear addresses, start addresses."""


def hex_segments(data: bytes) -> tuple[Segment, ...]:
    """Intel HEX."""
    pieces: list[Segment] = []
    base, ended = 0, False
    for number, line in _lines(data):
        record = _record(line, ":", 1)
        if len(record) < 5 or len(record) != 5 + record[0]:
            raise FormatError(f"line {number}: not an Intel HEX record")
        if sum(record) & 0xFF:
            raise FormatError(f"line {number}: wrong checksum")
        if ended:
            raise FormatError(f"line {number}: a record after the end record")
        offset, kind, body = int.from_bytes(record[1:3], "big"), record[3], record[4:-1]
        if kind == 0:
            pieces.append((base + offset, body))
        elif kind not in HEX_LENGTHS:
            raise FormatError(f"line {number}: unknown record type {kind:02X}")
        elif len(body) != HEX_LENGTHS[kind]:
            raise FormatError(
                f"line {number}: a record of type {kind:02X} has {HEX_LENGTHS[kind]} bytes, "
                f"not {len(body)}"
            )
        elif kind in (2, 4):
            base = int.from_bytes(body, "big") << (4 if kind == 2 else 16)
        ended = kind == 1
    if not ended:
        raise FormatError("has no end record: it is cut off")
    return joined(pieces)


ADDRESS_BYTES = {"1": 2, "2": 3, "3": 4, "5": 2, "6": 3, "7": 4, "8": 3, "9": 2, "0": 2}
"""Of S-records, by their type."""


def s_record_segments(data: bytes) -> tuple[Segment, ...]:
    """Motorola S-records: S1 to S3 are data, S7 to S9 end the file, S5 and S6 count."""
    pieces: list[Segment] = []
    ended = False
    for number, line in _lines(data):
        record = _record(line, "S", 2)
        width = ADDRESS_BYTES.get(line[1:2], 0)
        if not width or len(record) < width + 2 or len(record) != record[0] + 1:
            raise FormatError(f"line {number}: not an S-record")
        if sum(record) & 0xFF != 0xFF:
            raise FormatError(f"line {number}: wrong checksum")
        if ended:
            raise FormatError(f"line {number}: a record after the end record")
        address = int.from_bytes(record[1 : 1 + width], "big")
        if line[1] in "123":
            pieces.append((address, record[1 + width : -1]))
        elif line[1] in "56" and address != len(pieces):
            raise FormatError(f"line {number}: counts {address} data records, not {len(pieces)}")
        ended = line[1] in "789"
    if not ended:
        raise FormatError("has no end record: it is cut off")
    return joined(pieces)


# --- UF2 ------------------------------------------------------------------------------------------

UF2_BLOCK, UF2_DATA = 512, 476
UF2_START, UF2_END = (0x0A324655, 0x9E5D5157), 0x0AB16F30
NOT_FOR_FLASH = 1


class _Uf2Header(NamedTuple):
    first: int
    second: int
    flags: int
    address: int
    size: int
    number: int
    total: int
    family: int


def uf2_segments(data: bytes) -> tuple[Segment, ...]:
    """UF2: blocks of 512 bytes, each with its address; the family is not checked."""
    if len(data) % UF2_BLOCK:
        raise FormatError(f"is cut off: {len(data)} bytes are no whole blocks of {UF2_BLOCK}")
    pieces, seen = [], set()
    for at in range(0, len(data), UF2_BLOCK):
        block = data[at : at + UF2_BLOCK]
        header = _Uf2Header(*struct.unpack_from("<8I", block))
        (end,) = struct.unpack_from("<I", block, UF2_BLOCK - 4)
        index = at // UF2_BLOCK
        if (header.first, header.second) != UF2_START or end != UF2_END:
            raise FormatError(f"block {index}: not a UF2 block")
        if header.size > UF2_DATA:
            raise FormatError(f"block {index}: {header.size} bytes of data, at most {UF2_DATA}")
        if header.flags & NOT_FOR_FLASH:
            continue
        if header.total * UF2_BLOCK > len(data):
            raise FormatError(f"is cut off: block {index} is one of {header.total}")
        if header.number in seen:
            raise FormatError(f"block {index}: number {header.number} is there twice")
        seen.add(header.number)
        pieces.append((header.address, block[32 : 32 + header.size]))
    return joined(pieces)


# --- choice by contents ---------------------------------------------------------------------------


def format_of(data: bytes) -> Callable[[bytes], tuple[Segment, ...]] | None:
    """The reader for a file's contents; None if it has none of these formats."""
    if data.startswith(b"\x7fELF"):
        return elf_segments
    if data.startswith(struct.pack("<2I", *UF2_START)):
        return uf2_segments
    head = data.lstrip()[:4]
    if head[:1] == b":" and _is_hex(head[1:3]):
        return hex_segments
    if head[:1] == b"S" and head[1:2].isdigit() and _is_hex(head[2:4]):
        return s_record_segments
    return None


def _is_hex(text: bytes) -> bool:
    return len(text) == 2 and all(chr(byte) in "0123456789abcdefABCDEF" for byte in text)
