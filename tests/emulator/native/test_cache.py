"""The cache of compiled libraries: where it is, who may write there, and what leaves it."""

import os
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.native import cache
from cubestack.emulator.native.compiler import Compiler, find_compiler


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for temporary files of the test's own, and a cache folder that can not be."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file" / "below"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    cache._private_folder.cache_clear()
    yield tmp_path
    cache._private_folder.cache_clear()


def test_one_that_can_be_written_to_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "not" / "yet"))
    assert cache.cache_folder() == tmp_path / "not" / "yet" / "cubestack"


def test_else_a_private_one_takes_its_place(
    temporary: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = cache.cache_folder()
    assert folder == cache.cache_folder() == temporary / f"cubestack-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700
    (said,) = caplog.messages
    assert "below/cubestack can not be written to; what is compiled is kept in" in said


@pytest.mark.parametrize("mode", [0o755, 0o720])
def test_one_that_others_may_write_to_is_not_trusted(temporary: Path, mode: int) -> None:
    others = temporary / f"cubestack-{os.getuid()}"
    others.mkdir()
    others.chmod(mode)
    folder = cache.cache_folder()
    assert folder != others
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_link_that_somebody_laid_is_not_followed(temporary: Path) -> None:
    (temporary / "elsewhere").mkdir(mode=0o700)
    link = temporary / f"cubestack-{os.getuid()}"
    link.symlink_to(temporary / "elsewhere")
    assert cache.cache_folder() != link


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_what_nobody_uses_makes_room(tmp_path: Path) -> None:
    def build(_compiler: Compiler, scratch: Path, _log: Path) -> Path:
        built = scratch / "a.so"
        built.write_bytes(b"library")
        return built

    def library(name: str) -> Path:
        return cache.library_of(cache.recipe(name, name, [], build), tmp_path)

    used, unused = library("used"), library("unused")
    long_ago = time.time() - cache.UNUSED_S - 60
    for path in (used, unused):
        os.utime(path, (long_ago, long_ago))
    assert library("used") == used  # and now recently
    new = library("new")
    assert set(tmp_path.glob("*.so")) == {used, new}


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_who_comes_second_waits_for_what_is_being_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    builds, looked = list[Path](), threading.Event()
    find = cache._found

    def found(folder: Path, key: str) -> Path | None:
        library = find(folder, key)
        if threading.current_thread() is second:
            looked.set()
        return library

    def build(_compiler: Compiler, scratch: Path, _log: Path) -> Path:
        builds.append(scratch)
        if len(builds) == 1:
            second.start()
            assert looked.wait(30.0)
        library = scratch / "a.so"
        library.write_bytes(b"library")
        return library

    def ask() -> Path:
        return cache.library_of(cache.recipe("wanted", "wanted", [], build), tmp_path)

    second = threading.Thread(target=ask)
    monkeypatch.setattr(cache, "_found", found)
    ask()
    second.join(30.0)
    assert len(builds) == 1
