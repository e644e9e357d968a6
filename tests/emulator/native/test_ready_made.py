"""Libraries that come along: found when they fit, never when they don't."""

import io
import platform
from pathlib import Path

import pytest
from elftools.elf.dynamic import DynamicSection
from elftools.elf.elffile import ELFFile
from elftools.elf.gnuversions import GNUVerNeedSection

from cubestack.emulator.native import cache, ready_made
from cubestack.emulator.native.compiler import Compiler, NoCompilerError

MACHINE = platform.machine()
LIBRARY = b"\x7fELF and so on" * 1000


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where ready-made libraries are looked for."""
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr(platform, "libc_ver", lambda: ("glibc", "2.36"))
    monkeypatch.setattr(ready_made, "FOLDER", tmp_path)
    return tmp_path


def test_one_that_was_kept_is_found(folder: Path) -> None:
    path = ready_made.keep(MACHINE, b"design", LIBRARY, folder)
    assert ready_made.ready_made(b"design") == (ready_made.hash_of(LIBRARY), LIBRARY)
    assert ready_made.ready_made(b"another design") is None
    path.rename(folder / path.name.replace(MACHINE, "other"))
    assert ready_made.ready_made(b"design") is None


@pytest.mark.parametrize("change", [lambda old: old[:-1], lambda old: b"", lambda old: old[::-1]])
def test_a_damaged_one_is_not_taken(folder: Path, change) -> None:
    path = ready_made.keep(MACHINE, b"design", LIBRARY, folder)
    path.write_bytes(change(path.read_bytes()))
    assert ready_made.ready_made(b"design") is None


def test_one_with_the_bytes_of_another_is_not_taken(folder: Path) -> None:
    path = ready_made.keep(MACHINE, b"design", LIBRARY, folder)
    ready_made.keep(MACHINE, b"other", LIBRARY[::-1], folder).replace(path)
    assert ready_made.ready_made(b"design") is None


def test_who_names_a_compiler_gets_its_library(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready_made.keep(MACHINE, b"design", LIBRARY, folder)
    monkeypatch.setenv("CXX", "clang++")
    assert ready_made.ready_made(b"design") is None


def test_another_c_library_has_none(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ready_made.keep(MACHINE, b"design", LIBRARY, folder)
    monkeypatch.setattr(platform, "libc_ver", lambda: ("", ""))
    assert ready_made.ready_made(b"design") is None


def test_the_cache_takes_it_without_a_compiler(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def build(_compiler: Compiler, _scratch: Path, _log: Path) -> Path:
        raise AssertionError("nothing has to be built")

    monkeypatch.setattr(cache.compilers, "find_compiler", lambda: None)
    kept = folder / "cache"
    with cache.noted() as wanted, pytest.raises(NoCompilerError, match=r"cubestack\[compiler\]"):
        cache.cached_library("design", [], build, kept)
    ready_made.keep(MACHINE, wanted[0].inputs, LIBRARY, folder)
    library = cache.cached_library("design", [], build, kept)
    assert library.read_bytes() == LIBRARY
    assert cache.cached_library("design", [], build, kept) == library
    library.write_bytes(b"damaged")
    assert cache.cached_library("design", [], build, kept).read_bytes() == LIBRARY


def shipped() -> list[Path]:
    return sorted((Path(ready_made.__file__).parent / "libraries").iterdir())


@pytest.mark.parametrize("path", shipped(), ids=lambda path: path.name[:15])
def test_each_needs_nothing_but_an_old_c_library(path: Path) -> None:
    machine, inputs, digest = path.name.removesuffix(ready_made.SUFFIX).split("-")
    library = ready_made.lzma.decompress(path.read_bytes())
    assert ready_made.hash_of(library) == digest
    assert len(inputs) == len(digest)
    elf = ELFFile(io.BytesIO(library))
    assert elf["e_machine"] == {"x86_64": "EM_X86_64", "aarch64": "EM_AARCH64"}[machine]
    needs = set()
    for section in elf.iter_sections():
        if isinstance(section, DynamicSection):
            needs |= {tag.needed for tag in section.iter_tags() if tag.entry.d_tag == "DT_NEEDED"}
        if isinstance(section, GNUVerNeedSection):
            for _, versions in section.iter_versions():
                for one in versions:
                    numbers = one.name.removeprefix("GLIBC_").split(".")
                    assert tuple(map(int, numbers)) <= (2, 28)
    assert all(
        name.startswith(("libc.", "libm.", "libdl.", "libpthread.", "ld-")) for name in needs
    )
