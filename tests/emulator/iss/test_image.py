"""Images loaded from ELF, Intel HEX and binary files, and the errors of bad files."""

import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.iss.image import Image, ImageError, Memory, load_image

VECTORS = struct.pack("<II", 0x2000_8000, 0x0000_0009) + b"\xfe\xe7"


def elf(
    segments: list[tuple[int, bytes]],
    *, machine: int = 40, kind: int = 2, bits: int = 1, order: int = 1,
) -> bytes:  # fmt: skip
    """An ELF file with these segments."""
    ends = "<" if order == 1 else ">"
    ident = bytes([0x7F, *b"ELF", bits, order, 1]) + bytes(9)
    if bits == 2:
        return ident + struct.pack(ends + "HHIQQQIHHHHHH", kind, machine, 1, *[0] * 4, 64, *[0] * 5)
    table, offset = b"", 52 + 32 * len(segments)
    for address, data in segments:
        size = len(data)
        table += struct.pack(ends + "8I", 1, offset, address, address, size, size, 5, 4)
        offset += size
    counts = 52, 32, len(segments), 40, 0, 0
    header = struct.pack(ends + "HHIIIIIHHHHHH", kind, machine, 1, 9, 52, 0, 0x5000000, *counts)
    return ident + header + table + b"".join(data for _, data in segments)


def hex_record(kind: int, offset: int, data: bytes) -> str:
    record = bytes([len(data), *offset.to_bytes(2, "big"), kind]) + data
    return f":{record.hex().upper()}{-sum(record) & 0xFF:02X}\n"


def write(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_elf_hex_and_binary_file_load_the_same_image(tmp_path):
    records = hex_record(4, 0, b"\0\0") + hex_record(0, 0, VECTORS[:6])
    records += hex_record(0, 6, VECTORS[6:]) + hex_record(3, 0, bytes(4)) + hex_record(1, 0, b"")
    paths = [
        write(tmp_path, "a.elf", elf([(0, VECTORS)])),
        write(tmp_path, "a.hex", records),
        write(tmp_path, "a.bin", VECTORS),
    ]
    images = [load_image(path) for path in paths]
    assert {image.segments for image in images} == {((0, VECTORS),)}
    assert len({image.hash for image in images}) == 1
    assert [image.elf is not None for image in images] == [True, False, False]


def test_binary_file_is_loaded_at_its_base(tmp_path):
    path = write(tmp_path, "boot.bin", VECTORS)
    memory = Memory(flash_base=0x1000)
    assert load_image(f"{path}@0x1000", memory).segments == ((0x1000, VECTORS),)
    assert load_image(f"{path}@4096", memory).segments == ((0x1000, VECTORS),)
    odd = write(tmp_path, "odd@16", VECTORS)  # a file name, not a base
    assert load_image(odd).segments == ((0, VECTORS),)


def test_hex_records_set_the_upper_address(tmp_path):
    text = hex_record(0, 0, VECTORS) + hex_record(2, 0, b"\x10\x00") + hex_record(0, 4, b"ab")
    text += hex_record(4, 0, b"\x00\x02") + hex_record(0, 0x10, b"cd")
    found = load_image(write(tmp_path, "a.hex", text)).segments
    assert found == ((0, VECTORS), (0x10004, b"ab"), (0x20010, b"cd"))


BAD = {
    "empty.elf": (b"", "is empty"),
    "text.elf": (b"not an ELF", "is not an ELF file: it begins with b'not '"),
    "x86.elf": (elf([(0, VECTORS)], machine=62), "is for x64 with 32 bits, not for ARM with 32"),
    "wide.elf": (elf([], machine=183, bits=2), "is for AArch64 with 64 bits, not for ARM with 32"),
    "big.elf": (elf([(0, VECTORS)], order=2), "is big-endian: the core is little-endian"),
    "object.elf": (elf([(0, VECTORS)], kind=1), "is not an executable, but ET_REL"),
    "nothing.elf": (elf([]), "has nothing to load: no segment with bytes"),
    "cut.elf": (elf([(0, VECTORS)])[:60], "is a damaged ELF file: "),
    "beyond.elf": (
        elf([(0, VECTORS), (0xFFFFE, b"1234")]),
        "has bytes at 0x000ffffe..0x00100001, beyond the flash 0x00000000..0x000fffff",
    ),
    "ram.elf": (elf([(0x2000_0000, VECTORS)]), "beyond the flash"),
    "high.elf": (elf([(0x800, VECTORS)]), "has no vector table at 0x00000000"),
    "erased.bin": (b"\xff" * 64, "no vector table: stack pointer 0xffffffff, reset vector 0xffff"),
    "zeros.bin": (bytes(64), "no vector table: stack pointer 0x00000000, reset vector 0x00000000"),
    "long.bin": (VECTORS + bytes(1 << 20), "beyond the flash"),
    "text.hex": (b"hello", "is not an Intel HEX file"),
    "sum.hex": (b":0100000001FF\n", "line 1: wrong checksum"),
    "short.hex": (f"{hex_record(0, 0, VECTORS)}:0400\n", "line 2: not an Intel HEX record"),
    "kind.hex": (hex_record(7, 0, b""), "line 1: unknown record type 07"),
    "none.hex": (hex_record(1, 0, b""), "has no data records"),
}


@pytest.mark.parametrize("name", BAD)
def test_error_of_a_bad_file_is_one_line_with_its_path(tmp_path, name):
    content, wanted = BAD[name]
    path = write(tmp_path, name, content)
    with pytest.raises(ImageError) as caught:
        load_image(path)
    text = str(caught.value)
    assert text.startswith(str(path))
    assert wanted in text
    assert "\n" not in text


def test_missing_file_and_folder_are_errors(tmp_path):
    with pytest.raises(ImageError, match=r"none\.elf: No such file or directory$"):
        load_image(tmp_path / "none.elf")
    with pytest.raises(ImageError, match="Is a directory"):
        load_image(tmp_path)


def test_damaged_files_are_refused_or_read(tmp_path):
    random = np.random.default_rng(5)
    good = elf([(0, VECTORS), (0x100, bytes(100))])
    for number in range(400):
        damaged = bytearray(good)
        for place in random.integers(len(damaged), size=random.integers(1, 6)):
            damaged[place] = random.integers(256)
        path = write(tmp_path, f"{number}.elf", bytes(damaged[: random.integers(1, len(good))]))
        with suppress(ImageError):  # no other exception
            assert isinstance(load_image(path), Image)
