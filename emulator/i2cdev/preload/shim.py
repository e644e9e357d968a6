"""Builds the libraries for LD_PRELOAD, once, in the user's cache folder."""

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import struct
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.native.cache import cache_folder, hash_of, intact, make_folder
from cubestack.emulator.native.compiler import CompilerError, NoCompilerError, run_compiler
from cubestack.firmware_model.formats.i2c_socket import VERSION, Call
from cubestack.firmware_model.formats.linux_i2c import MAX_MESSAGE_BYTES, SMBUS_DATA_BYTES

SOURCE = Path(__file__).with_name("shim.c")
"""It includes the other files of C in its folder, but ``REPEAT``."""

REPEAT = "repeat.c"

FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-Wall")
LIBRARIES = ("-ldl", "-lpthread")
"""Separate libraries before glibc 2.34."""

PT_INTERP = 3
CLASS_64 = 2
LITTLE_ENDIAN = 1

_TABLE = struct.Struct("<Q14xHH")  # at 32: e_phoff; at 54: e_phentsize, e_phnum
_TABLE_AT = 32
_TYPE = struct.Struct("<I")


def find_c_compiler() -> list[str] | None:
    """``$CC``, else a compiler on the PATH, else that of the ziglang wheel, else None."""
    for candidate in (shlex.split(os.environ.get("CC", "")), ["cc"], ["gcc"], ["clang"]):
        program = shutil.which(candidate[0]) if candidate else None
        if program is not None:
            return [program, *candidate[1:]]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-P", "-m", "ziglang", "cc"]
    return None


def shim_library(folder: Path | None = None) -> Path:
    """The library of the preload route, from the cache or built now.

    ``folder`` replaces the cache folder.

    Raises:
        NoCompilerError: there is no C compiler.
        CompilerError: the compiler failed; the message names the log.
    """
    return _library(SOURCE, folder)


def repeat_library(folder: Path | None = None) -> Path:
    """The library that repeats calls under the seccomp route, as ``shim_library``."""
    return _library(SOURCE.with_name(REPEAT), folder)


def _library(source: Path, folder: Path | None) -> Path:
    folder = cache_folder() if folder is None else folder
    compiler = find_c_compiler()
    if compiler is None:
        raise NoCompilerError("no C compiler (cc, gcc, clang or the ziglang wheel) found")
    key = f"i2c-{source.stem}-{_key(compiler)}"
    if (library := intact(folder, key)) is not None:
        return library
    try:
        make_folder(folder)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            built = Path(scratch) / "shim.so"
            options = [*FLAGS, *_definitions(), str(source), "-o", str(built), *LIBRARIES]
            run_compiler(compiler, options, built, folder / f"{key}.log")
            library = folder / f"{key}-{hash_of(built.read_bytes())}.so"
            built.replace(library)
    except OSError as error:
        raise CompilerError(
            f"can not use the cache folder {folder} ({error.strerror}); "
            "set XDG_CACHE_HOME to another one"
        ) from error
    return library


def _definitions() -> list[str]:
    listing = DeviceNode(0).listing.replace("i2c-0", "i2c-%d", 1)
    text = listing.replace("\t", "\\t").replace("\n", "\\n")
    return [
        f'-DLISTING_FORMAT="{text}"',
        f"-DSOCKET_VERSION={VERSION}",
        f"-DMAX_MESSAGE_BYTES={MAX_MESSAGE_BYTES}",
        f"-DSMBUS_DATA_BYTES={SMBUS_DATA_BYTES}",
        *(f"-DCALL_{call.name}={int(call)}" for call in Call),
    ]


def _key(compiler: list[str]) -> str:
    zig = version("ziglang") if "ziglang" in compiler else ""
    texts = (shlex.join(compiler), zig, platform.machine(), *FLAGS, *_definitions())
    digest = hashlib.sha256("\0".join(texts).encode())
    for part in sorted(SOURCE.parent.glob("*.c")):
        digest.update(part.read_bytes())
    return digest.hexdigest()[:24]


def is_static(program: Path) -> bool:
    """Whether a 64-bit ``program`` has no interpreter (System V ABI, chapter 5: PT_INTERP).

    False for scripts and unreadable files; the kernel reports their errors.
    """
    try:
        with program.open("rb") as file:
            head = file.read(64)
            if len(head) < 64 or head[:6] != b"\x7fELF" + bytes((CLASS_64, LITTLE_ENDIAN)):
                return False
            start, size, count = _TABLE.unpack_from(head, _TABLE_AT)
            file.seek(start)
            table = file.read(size * count)
    except (OSError, ValueError, OverflowError):
        return False
    if size < _TYPE.size or len(table) < size * count:
        return False
    types = [_TYPE.unpack_from(table, size * index)[0] for index in range(count)]
    return PT_INTERP not in types
