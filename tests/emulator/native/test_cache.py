"""Which compiler is taken, the cache of compiled libraries, and those inside a wheel."""

import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.emulator.native import cache, compiler
from cubestack.emulator.native.compiler import Compiler, NoCompilerError, find_compiler
from tests.emulator.conftest import make_compiler


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for temporary files of the test's own, and a cache folder that can not be."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file" / "below"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    cache._private_folder.cache_clear()
    yield tmp_path
    cache._private_folder.cache_clear()


def test_writable_cache_folder_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "not" / "yet"))
    assert cache.cache_folder() == tmp_path / "not" / "yet" / "cubestack"


def test_unwritable_cache_is_replaced_by_a_private_folder(
    temporary: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = cache.cache_folder()
    assert folder == cache.cache_folder() == temporary / f"cubestack-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700
    (said,) = caplog.messages
    assert "below/cubestack can not be written to; what is compiled is kept in" in said


@pytest.mark.parametrize("mode", [0o755, 0o720])
def test_cache_folder_with_open_permissions_is_not_trusted(temporary: Path, mode: int) -> None:
    others = temporary / f"cubestack-{os.getuid()}"
    others.mkdir()
    others.chmod(mode)
    folder = cache.cache_folder()
    assert folder != others
    assert folder.stat().st_mode & 0o777 == 0o700


def test_cache_folder_ignores_an_existing_symlink(temporary: Path) -> None:
    (temporary / "elsewhere").mkdir(mode=0o700)
    link = temporary / f"cubestack-{os.getuid()}"
    link.symlink_to(temporary / "elsewhere")
    assert cache.cache_folder() != link


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_unused_cached_libraries_are_removed(tmp_path: Path) -> None:
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
def test_second_builder_waits_for_the_first(
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


def test_cxx_variable_is_preferred_and_versions_distinguish_compilers(tmp_path, monkeypatch):
    monkeypatch.setenv("CXX", str(make_compiler(tmp_path, "mycc", "exit 1", "one")))
    first = compiler.find_compiler()
    assert first is not None
    assert first.command == (str(tmp_path / "mycc"),)
    make_compiler(tmp_path, "mycc", "exit 1", "two")
    assert compiler.find_compiler() != first


def test_broken_compiler_is_skipped(without_compiler, tmp_path):
    (tmp_path / "c++").write_text("#!/bin/sh\nexit 1\n")
    (tmp_path / "c++").chmod(0o755)
    assert compiler.find_compiler() is None
    make_compiler(tmp_path, "clang++", "exit 1")
    found = compiler.find_compiler()
    assert found is not None
    assert found.command == (str(tmp_path / "clang++"),)


def test_ziglang_wheel_is_the_last_resort(without_compiler, monkeypatch):
    monkeypatch.setattr(
        compiler.importlib.util, "find_spec", lambda name: name == "ziglang" or None
    )
    monkeypatch.setattr(compiler, "version", lambda name: f"7.8 of {name}")
    assert compiler.find_compiler() == compiler.Compiler(
        (sys.executable, "-P", "-m", "ziglang", "c++"), "ziglang 7.8 of ziglang"
    )


def test_cache_folder_follows_xdg_cache_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.cache_folder() == tmp_path / "cubestack"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    assert cache.cache_folder() == Path.home() / ".cache" / "cubestack"


LIBRARY = b"\x7fELF and so on" * 1000


def refuse_to_build(_compiler: Compiler, _scratch: Path, _log: Path) -> Path:
    raise AssertionError("nothing must be built")


RECIPE = cache.recipe("a design", "design", [], refuse_to_build)


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The shipped library; there is no compiler."""
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr(cache.compilers, "find_compiler", lambda: None)
    monkeypatch.setattr(cache, "SHIPPED", tmp_path)
    name = f"{cache.hash_of(RECIPE.inputs)}-{cache.hash_of(LIBRARY)}.so"
    (tmp_path / name).write_bytes(LIBRARY)
    return tmp_path / name


def test_shipped_library_loads_without_a_compiler_or_matching_tools(shipped: Path) -> None:
    newer = cache.recipe("a design", "design", [], refuse_to_build, [b"another version of a tool"])
    assert cache.library_of(RECIPE) == cache.library_of(newer) == shipped


@pytest.mark.parametrize("change", [lambda old: old[:-1], lambda old: b"", lambda old: old[::-1]])
def test_damaged_library_is_not_loaded(shipped: Path, change) -> None:
    shipped.write_bytes(change(LIBRARY))
    with pytest.raises(NoCompilerError, match="run: pip install ziglang"):
        cache.library_of(RECIPE)


@pytest.mark.usefixtures("shipped")
def test_library_of_another_design_is_not_loaded() -> None:
    with pytest.raises(NoCompilerError):
        cache.library_of(cache.recipe("a design", "another design", [], refuse_to_build))


@pytest.mark.usefixtures("shipped")
def test_cxx_chooses_a_compiler_over_the_shipped_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "clang++")
    with pytest.raises(NoCompilerError):
        cache.library_of(RECIPE)


def test_recipes_are_only_listed_while_being_collected(shipped: Path) -> None:
    with cache.collected() as recipes, pytest.raises(NoCompilerError, match="only listed"):
        cache.library_of(RECIPE)
    assert recipes == [RECIPE]


def test_cache_that_others_could_write_to_is_emptied_and_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "cubestack"
    (folder / "gateware").mkdir(parents=True)
    for path in (folder / "planted.so", folder / "gateware" / "planted.json"):
        path.touch()
    folder.chmod(0o777)
    assert cache.cache_folder() == folder
    assert folder.stat().st_mode & 0o777 == 0o755
    assert not list(folder.iterdir())
    assert "others could write to" in caplog.text


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_cache_of_another_user_is_not_used(
    temporary: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(temporary))
    (temporary / "cubestack").mkdir()
    os.chown(temporary / "cubestack", 12345, 12345)
    assert cache.cache_folder() == temporary / f"cubestack-{os.getuid()}"
    assert "belongs to another user" in caplog.text


def test_unknown_home_is_replaced(temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", fail)
    assert cache.cache_folder() == temporary / f"cubestack-{os.getuid()}"


def test_new_cache_folder_is_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    before = os.umask(0o002)
    try:
        folder = cache.cache_folder()
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700


def test_library_with_other_bytes_than_its_name_says_is_not_loaded(tmp_path: Path) -> None:
    good = tmp_path / f"key-{cache.hash_of(b'good')}.so"
    good.write_bytes(b"bad")
    assert cache.intact(tmp_path, "key") is None
    good.write_bytes(b"good")
    assert cache.intact(tmp_path, "key") == good
