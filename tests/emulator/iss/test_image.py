"""Images loaded from all formats of programs, and the errors of bad files."""

import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.iss.image import Image, ImageError, Memory, load_image
from cubestack.emulator.iss.machine import Machine

VECTORS = struct.pack("<II", 0x2000_8000, 0x0000_0009) + b"\xfe\xe7"


def elf(
    segments: list[tuple[int, bytes]],
    *, machine: int = 40, kind: int = 2, bits: int = 1, order: int = 1, entry: int = 9,
    sections: int = 0,
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
    counts = 52, 32, len(segments), 40, sections, 0
    end = offset if sections else 0
    header = struct.pack(
        ends + "HHIIIIIHHHHHH", kind, machine, 1, entry, 52, end, 0x5000000, *counts
    )
    return ident + header + table + b"".join(data for _, data in segments)


def hex_record(kind: int, offset: int, data: bytes) -> str:
    record = bytes([len(data), *offset.to_bytes(2, "big"), kind]) + data
    return f":{record.hex().upper()}{-sum(record) & 0xFF:02X}\n"


def s_record(kind: int, address: int, data: bytes = b"") -> str:
    width = {1: 2, 2: 3, 3: 4, 5: 2, 7: 4, 8: 3, 9: 2, 0: 2}[kind]
    body = address.to_bytes(width, "big") + data
    record = bytes([len(body) + 1]) + body
    return f"S{kind}{record.hex().upper()}{~sum(record) & 0xFF:02X}\n"


def uf2(*blocks: tuple[int, bytes], count: int | None = None, flags: int = 0) -> bytes:
    """UF2 blocks with these addresses and bytes."""
    count = len(blocks) if count is None else count
    return b"".join(
        struct.pack("<8I", 0x0A324655, 0x9E5D5157, flags, address, len(data), number, count, 0)
        + data.ljust(476, b"\0")
        + struct.pack("<I", 0x0AB16F30)
        for number, (address, data) in enumerate(blocks)
    )


END = hex_record(1, 0, b"")


def write(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_all_formats_load_the_same_image(tmp_path):
    records = hex_record(4, 0, b"\0\0") + hex_record(0, 0, VECTORS[:6])
    records += hex_record(0, 6, VECTORS[6:]) + hex_record(3, 0, bytes(4)) + hex_record(1, 0, b"")
    srec = s_record(0, 0, b"name") + s_record(1, 0, VECTORS[:4]) + s_record(2, 4, VECTORS[4:6])
    srec += s_record(3, 6, VECTORS[6:]) + s_record(5, 3) + s_record(9, 0)
    files = {
        "a.elf": elf([(0, VECTORS)]),
        "a.hex": records,
        "a.s19": srec,
        "a.uf2": uf2((0, VECTORS[:4]), (4, VECTORS[4:])),
    }
    images = [load_image(write(tmp_path, name, content)) for name, content in files.items()]
    images.append(load_image(write(tmp_path, "a.bin", VECTORS), base=0))
    # The contents decide, not the name.
    images += [load_image(write(tmp_path, f"{n}", text)) for n, text in enumerate(files.values())]
    assert {image.segments for image in images} == {((0, VECTORS),)}
    assert len({image.hash for image in images}) == 1
    assert [image.elf is not None for image in images[:5]] == [True, *[False] * 4]


def test_binary_file_is_loaded_at_its_base(tmp_path):
    path = write(tmp_path, "boot.bin", VECTORS)
    memory = Memory(flash_base=0x1000)
    vectors = struct.pack("<II", 0x2000_8000, 0x1009) + b"\xfe\xe7"
    path.write_bytes(vectors)
    assert load_image(f"{path}@0x1000", memory).segments == ((0x1000, vectors),)
    assert load_image(f"{path}@4096", memory).segments == ((0x1000, vectors),)
    assert load_image(path, memory, base=0x1000).segments == ((0x1000, vectors),)
    odd = write(tmp_path, "odd@16", VECTORS)  # a file name, not a base
    assert load_image(odd, base=0).segments == ((0, VECTORS),)
    with pytest.raises(ImageError, match="has its own addresses; only raw bytes take a base"):
        load_image(write(tmp_path, "a.elf", elf([(0, VECTORS)])), base=0)


def test_user_page_and_lock_bits_are_loaded(tmp_path):
    text = hex_record(0, 0, VECTORS) + hex_record(4, 0, b"\x0f\xe0") + hex_record(0, 0x10, b"user")
    text += hex_record(0, 0x4000 + 4 * 126, b"\xfe\xff\xff\xff")
    path = write(tmp_path, "a.hex", text + END)
    machine = Machine()
    machine.information[:8192] = 0
    machine.load(load_image(path))
    assert machine.peek(0x0FE0_0010, 5) == b"user\xff"
    assert machine.peek(0x0FE0_4000 + 4 * 126, 4) == b"\xfe\xff\xff\xff"


def test_hex_records_set_the_upper_address(tmp_path):
    text = hex_record(0, 0, VECTORS) + hex_record(2, 0, b"\x10\x00") + hex_record(0, 4, b"ab")
    text += hex_record(4, 0, b"\x00\x02") + hex_record(0, 0x10, b"cd") + END
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
    "cut segment.elf": (
        elf([(0, VECTORS)])[:-1],
        "is a damaged ELF file: its segment 0 ends at byte 94, the file at 93",
    ),
    "cut sections.elf": (
        elf([(0, VECTORS)], sections=3),
        "is a damaged ELF file: its section header table ends at byte 214, the file at 94",
    ),
    "entry.elf": (elf([(0, VECTORS)], entry=0x801), "has its entry 0x00000801 outside of what"),
    "twice.elf": (elf([(0, VECTORS), (8, b"ab")]), "has two contents for address 0x00000008"),
    "stack.elf": (elf([(0, VECTORS[4:] * 2)]), "the stack is not in RAM"),
    "even.elf": (
        elf([(0, VECTORS[:4] + b"\x08\0\0\0" + VECTORS[8:])]),
        "reset vector 0x00000008; the latter is not the address of Thumb code in the program",
    ),
    "far.elf": (
        elf([(0, VECTORS[:4] + b"\1\1\0\0" + VECTORS[8:])]),
        "not the address of Thumb code",
    ),
    "beyond.elf": (
        elf([(0, VECTORS), (0xFFFFE, b"1234")]),
        "has bytes at 0x000ffffe..0x00100001, beyond the flash 0x00000000..0x000fffff",
    ),
    "ram.elf": (elf([(0x2000_0000, VECTORS)], entry=0), "beyond the flash"),
    "high.elf": (elf([(0x800, VECTORS)], entry=0), "has no vector table at 0x00000000"),
    "erased.bin": (b"\xff" * 64, "no vector table: stack pointer 0xffffffff, reset vector 0xffff"),
    "zeros.bin": (bytes(64), "no vector table: stack pointer 0x00000000, reset vector 0x00000000"),
    "long.bin": (VECTORS + bytes(1 << 20), "beyond the flash"),
    "text.hex": (b"hello", "is not an Intel HEX file"),
    "sum.hex": (b":0100000001FF\n", "line 1: wrong checksum"),
    "short.hex": (f"{hex_record(0, 0, VECTORS)}:0400\n", "line 2: not an Intel HEX record"),
    "kind.hex": (hex_record(7, 0, b""), "line 1: unknown record type 07"),
    "none.hex": (END, "has no data records"),
    "open.hex": (hex_record(0, 0, VECTORS), "has no end record: it is cut off"),
    "after.hex": (
        hex_record(0, 0, VECTORS) + END + hex_record(0, 16, b"a"),
        "line 3: a record after the end record",
    ),
    "twice.hex": (
        hex_record(0, 0, VECTORS) + hex_record(0, 4, b"a") + END,
        "has two contents for address 0x00000004",
    ),
    "width.hex": (hex_record(4, 0, b"\1") + END, "a record of type 04 has 2 bytes, not 1"),
    "open.s19": (s_record(1, 0, VECTORS), "has no end record: it is cut off"),
    "sum.s19": ("S10500004142FF\n", "line 1: wrong checksum"),
    "short.s19": ("S1FF0000\n", "line 1: not an S-record"),
    "count.s19": (
        s_record(1, 0, VECTORS) + s_record(5, 2) + s_record(9, 0),
        "line 2: counts 2 data records, not 1",
    ),
    "after.s19": (
        s_record(1, 0, VECTORS) + s_record(9, 0) + s_record(1, 32, b"a"),
        "line 3: a record after the end record",
    ),
    "text.s19": (b"hello", "is not a file of S-records"),
    "cut.uf2": (uf2((0, VECTORS))[:-1], "is cut off: 511 bytes are no whole blocks of 512"),
    "missing.uf2": (uf2((0, VECTORS), count=2), "is cut off: block 0 is one of 2"),
    "magic.uf2": (uf2((0, VECTORS))[:-4] + bytes(4), "block 0: not a UF2 block"),
    "same.uf2": (uf2((0, VECTORS)) + uf2((64, VECTORS)), "block 1: number 0 is there twice"),
    "empty.uf2": (uf2((0, VECTORS), flags=1), "has no data records"),
    "main.c": (b"int x;\n", "is a C source file; expected ELF"),
    "main": (b"#include <a.h>\nint main(void);\n", "is a C source file; expected ELF"),
    "notes.txt": (b"dear all\n", "is a text file; expected ELF"),
    "photo": (b"\x89PNG\r\n", "is a PNG image; expected ELF"),
    "libc.a": (b"!<arch>\n", "is a static library; expected ELF"),
    "program": (
        VECTORS,
        "is raw bytes, the first are 00 80 00 20; expected ELF, Intel HEX, "
        "S-records or UF2, or raw bytes with --firmware-base ADDRESS",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_error_of_a_bad_file_is_one_line_with_its_path(tmp_path, name):
    content, wanted = BAD[name]
    path = write(tmp_path, name, content)
    with pytest.raises(ImageError) as caught:
        load_image(path, base=0 if path.suffix == ".bin" else None)
    text = str(caught.value)
    assert text.startswith(str(path))
    assert wanted in text
    assert "\n" not in text


def test_missing_file_and_folder_are_errors(tmp_path):
    with pytest.raises(ImageError, match=r"none\.elf: No such file or directory$"):
        load_image(tmp_path / "none.elf")
    with pytest.raises(ImageError, match=r"is a folder, not a regular file$"):
        load_image(tmp_path)


def test_damaged_files_are_refused_or_read(tmp_path):
    random = np.random.default_rng(5)
    good = elf([(0, VECTORS), (0x100, bytes(100))])
    others = uf2((0, VECTORS)), (hex_record(0, 0, VECTORS) + END).encode()
    for number in range(600):
        damaged = bytearray((good, good, *others)[number % 4])
        for place in random.integers(len(damaged), size=random.integers(1, 6)):
            damaged[place] = random.integers(256)
        cut = random.integers(1, len(damaged) + 1)
        path = write(tmp_path, f"{number}", bytes(damaged[:cut]))
        with suppress(ImageError):  # no other exception
            assert isinstance(load_image(path), Image)
