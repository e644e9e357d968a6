"""Builds the library for LD_PRELOAD once, and keeps it in the user's cache folder."""

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.rtl.cxxrtl.build import CompilerError, NoCompilerError, cache_folder
from cubestack.firmware_model.formats.linux_i2c import MAX_MESSAGE_BYTES, SMBUS_DATA_BYTES, Call

SOURCE = Path(__file__).with_name("shim.c")
FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-Wall")
LIBRARIES = ("-ldl", "-lpthread")
"""Before glibc 2.34 these two are libraries of their own."""


def find_c_compiler() -> list[str] | None:
    """Take ``$CC``, else one on the PATH, else the one of the ziglang wheel, else None."""
    for candidate in (shlex.split(os.environ.get("CC", "")), ["cc"], ["gcc"], ["clang"]):
        program = shutil.which(candidate[0]) if candidate else None
        if program is not None:
            return [program, *candidate[1:]]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    return None


def shim_library(folder: Path | None = None) -> Path:
    """The shared library, from the cache or built now; ``folder`` replaces the cache folder.

    Raises:
        NoCompilerError: it is not there, and there is no C compiler.
        CompilerError: it failed; the message names the log.
    """
    folder = cache_folder() if folder is None else folder
    compiler = find_c_compiler()
    if compiler is None:
        raise NoCompilerError("no C compiler (cc, gcc, clang or the ziglang wheel) found")
    library = folder / f"i2c-{_key(compiler)}.so"
    if library.is_file():
        return library
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            built = Path(scratch) / "shim.so"
            _compile(compiler, built, library.with_suffix(".log"))
            built.replace(library)
    except OSError as error:
        raise CompilerError(
            f"can not use the cache folder {folder} ({error.strerror}); "
            "XDG_CACHE_HOME names another one"
        ) from error
    return library


def _definitions() -> list[str]:
    """What the source takes from the tables."""
    listing = DeviceNode(0).listing.replace("i2c-0", "i2c-%d", 1)
    text = listing.replace("\t", "\\t").replace("\n", "\\n")
    return [
        f'-DLISTING_FORMAT="{text}"',
        f"-DMAX_MESSAGE_BYTES={MAX_MESSAGE_BYTES}",
        f"-DSMBUS_DATA_BYTES={SMBUS_DATA_BYTES}",
        *(f"-DCALL_{call.name}={int(call)}" for call in Call),
    ]


def _key(compiler: list[str]) -> str:
    zig = version("ziglang") if "ziglang" in compiler else ""
    texts = (shlex.join(compiler), zig, platform.machine(), *FLAGS, *_definitions())
    digest = hashlib.sha256("\0".join(texts).encode())
    digest.update(SOURCE.read_bytes())
    return digest.hexdigest()[:24]


def _compile(compiler: list[str], library: Path, log: Path) -> None:
    command = [*compiler, *FLAGS, *_definitions(), str(SOURCE), "-o", str(library), *LIBRARIES]
    with log.open("w") as output:
        output.write(shlex.join(command) + "\n")
        output.flush()
        done = subprocess.run(command, stdout=output, stderr=subprocess.STDOUT)
    if done.returncode != 0 or not library.exists():
        raise CompilerError(f"{shlex.join(compiler)} failed; its log is {log}")
