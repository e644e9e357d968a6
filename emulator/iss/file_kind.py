"""What a file is that is no program, in words for a message."""

from pathlib import Path

MAGIC = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "a gzip file",
    b"\xfd7zXZ": "an xz file",
    b"BZh": "a bzip2 file",
    b"7z\xbc\xaf": "a 7-Zip archive",
    b"!<arch>": "a static library",
    b"MZ": "a Windows program",
    b"\xcf\xfa\xed\xfe": "a macOS program",
    b"\xca\xfe\xba\xbe": "a macOS program or Java class",
    b"\0asm": "a WebAssembly module",
    b"SQLite format 3": "an SQLite database",
    b"#!": "a script",
}
SUFFIXES = {
    ".c": "a C source file",
    ".h": "a C header",
    ".cpp": "a C++ source file",
    ".cc": "a C++ source file",
    ".hpp": "a C++ header",
    ".s": "an assembler source file",
    ".asm": "an assembler source file",
    ".py": "a Python source file",
    ".rs": "a Rust source file",
    ".ld": "a linker script",
    ".map": "a linker map",
    ".json": "a JSON file",
    ".toml": "a TOML file",
    ".xml": "an XML file",
    ".svd": "an SVD file",
    ".md": "a Markdown file",
    ".v": "a Verilog source file",
    ".sv": "a SystemVerilog source file",
    ".vhd": "a VHDL source file",
}
"""Of text files."""

HINTS = {
    b"#include": "a C source file",
    b"int main": "a C source file",
    b"<?xml": "an XML file",
    b"<html": "an HTML file",
    b"<!DOCTYPE": "an HTML file",
    b".syntax unified": "an assembler source file",
    b"import ": "a Python source file",
}
"""Contents of text files without a known suffix."""

LOOKED_AT = 4096
PRINTABLE = bytes(range(32, 127)) + b"\t\n\r\f\v\b\x1b"


def is_text(data: bytes) -> bool:
    head = data[:LOOKED_AT]
    try:
        text = head.decode("utf-8", "strict" if len(data) <= LOOKED_AT else "ignore")
    except UnicodeDecodeError:
        return False
    return not any(ord(one) < 128 and ord(one) not in PRINTABLE for one in text)


def kind_of_file(path: Path, data: bytes) -> str:
    """For example "a C source file"."""
    for magic, kind in MAGIC.items():
        if data.startswith(magic):
            return kind
    if data[257:262] == b"ustar":
        return "a tar archive"
    if not is_text(data):
        return f"raw bytes, the first are {data[:4].hex(' ')}"
    if path.suffix.lower() in SUFFIXES:
        return SUFFIXES[path.suffix.lower()]
    for hint, kind in HINTS.items():
        if hint in data[:LOOKED_AT]:
            return kind
    return "a text file"
