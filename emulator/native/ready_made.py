"""Libraries of the shipped designs that come along, so that a first start needs no compiler.

A file's name carries its machine, a hash of everything that the library is made of but the
compiler, and the hash of its own bytes: one that does not fit what is installed is not found, and
a damaged one is noticed. ``python -m cubestack.host.emulation.libraries`` makes them anew.
"""

import hashlib
import lzma
import os
import platform
from contextlib import suppress
from pathlib import Path

FOLDER = Path(__file__).parent / "libraries"

SUFFIX = ".so.xz"

TARGETS = {"x86_64": "x86_64-linux-gnu.2.28", "aarch64": "aarch64-linux-gnu.2.28"}
"""Machine to the oldest system that its libraries are for; 2.28 is Debian 10's C library."""


def hash_of(content: bytes) -> str:
    """What stands for bytes in a file's name."""
    return hashlib.sha256(content).hexdigest()[:24]


def ready_made(inputs: bytes, folder: Path | None = None) -> tuple[str, bytes] | None:
    """Hash and bytes of this machine's library made of ``inputs``, None where there is none.

    ``$CXX`` says that the user wants it compiled. ``folder`` replaces ``FOLDER``.
    """
    if os.environ.get("CXX") or platform.libc_ver()[0] != "glibc":
        return None
    for path in (folder or FOLDER).glob(f"{platform.machine()}-{hash_of(inputs)}-*{SUFFIX}"):
        expected = path.name.removesuffix(SUFFIX).rpartition("-")[2]
        with suppress(OSError, lzma.LZMAError):
            library = lzma.decompress(path.read_bytes())
            if hash_of(library) == expected:
                return expected, library
    return None


def keep(machine: str, inputs: bytes, library: bytes, folder: Path) -> Path:
    """Put a library where :func:`ready_made` finds it."""
    path = folder / f"{machine}-{hash_of(inputs)}-{hash_of(library)}{SUFFIX}"
    path.write_bytes(lzma.compress(library, preset=9 | lzma.PRESET_EXTREME))
    return path
