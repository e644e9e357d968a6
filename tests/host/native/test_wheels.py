"""Release files are complete, installable and reproducible."""

import subprocess
import sys
import tarfile
import threading
import venv
import zipfile
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native import cache
from cubestack.emulator.native.cache import recipe
from cubestack.emulator.native.compiler import Compiler
from cubestack.host.native import shipped, wheels

PLATFORM = "manylinux_2_17_x86_64"
MUSL = "names musl"
LIBRARIES = {"b-2.so": b"second", "a-1.so": b"first"}


@pytest.fixture
def pure(tmp_path: Path) -> tuple[Path, Path]:
    """A small source distribution, and a wheel like that of setuptools."""
    tree = tmp_path / "cubestack-1"
    tree.mkdir()
    (tree / "data.py").write_text("x = 1\n")
    (tree / "setup.sh").write_text("true\n")
    (tree / "setup.sh").chmod(0o755)
    source, wheel = tmp_path / "cubestack-1.tar.gz", tmp_path / "cubestack-1-py3-none-any.whl"
    with tarfile.open(source, "w:gz") as archive:
        archive.add(tree, tree.name)
    about = "cubestack-1.dist-info"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("cubestack/__init__.py", "")
        archive.writestr(f"{about}/WHEEL", "Root-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}/METADATA", "Name: cubestack\nVersion: 1\n")
        archive.writestr(f"{about}/RECORD", "cubestack/__init__.py,,\n")
    return source, wheel


@pytest.fixture
def wheel(pure: tuple[Path, Path], tmp_path: Path) -> Path:
    return wheels.packed_wheel(pure[1], PLATFORM, LIBRARIES, tmp_path)


def test_wheel_contains_the_libraries_and_records_them(wheel: Path) -> None:
    assert wheel.name.endswith(f"-py3-none-{PLATFORM}.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/WHEEL"))
        text = archive.read(metadata).decode()
        record = archive.read(metadata.replace("WHEEL", "RECORD")).decode().splitlines()
        assert archive.read("cubestack/emulator/native/libraries/a-1.so") == b"first"
    assert f"Tag: py3-none-{PLATFORM}\n" in text
    assert "Root-Is-Purelib: false\n" in text
    assert "none-any" not in text
    assert sorted(line.split(",")[0] for line in record) == sorted(names)
    assert len(set(names)) == len(names)
    folder = "cubestack/emulator/native/libraries"
    (line,) = (line for line in record if line.startswith(f"{folder}/a-1.so"))
    assert line == f"{folder}/a-1.so,sha256=p5N7ZLjKpY8Dchu2us9ceMsjX-vg5wsbhM2ZVBRhoI4,5"


@pytest.mark.slow
def test_pip_installs_the_packed_wheel_with_its_libraries(tmp_path: Path) -> None:
    pure = wheels.pure_files(tmp_path)
    tag = f"linux_{wheels.os.uname().machine}"  # of this machine, whatever it is
    wheel = wheels.packed_wheel(pure[1], tag, LIBRARIES, tmp_path)
    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    call = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "-q"]
    subprocess.run([*call, "--no-index", str(wheel)], check=True)
    program = (
        "from cubestack.emulator.native.cache import SHIPPED as s; print(*sorted(s.iterdir()))"
    )
    done = subprocess.run([python, "-c", program], check=True, capture_output=True, text=True)
    assert [Path(one).name for one in done.stdout.split()] == sorted(LIBRARIES)


def test_same_content_packs_to_the_same_bytes(
    pure: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = []
    for name, libraries in (("one", LIBRARIES), ("two", dict(reversed(LIBRARIES.items())))):
        (tmp_path / name).mkdir()
        wheel = wheels.packed_wheel(pure[1], PLATFORM, libraries, tmp_path / name)
        source = wheels.packed_source(pure[0], tmp_path / name)
        packed.append((wheel.read_bytes(), source.read_bytes()))
    assert packed[0] == packed[1]
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    source = wheels.packed_source(pure[0], tmp_path)
    with tarfile.open(source) as archive:
        assert {one.mtime for one in archive} == {1700000000}
        assert {(one.uid, one.gid, one.uname) for one in archive} == {(0, 0, "")}
    wheel = wheels.packed_wheel(pure[1], PLATFORM, LIBRARIES, tmp_path)
    with zipfile.ZipFile(wheel) as archive:
        assert {one.date_time for one in archive.infolist()} == {(2023, 11, 14, 22, 13, 20)}


def test_source_distribution_keeps_content_and_executables(
    pure: tuple[Path, Path], tmp_path: Path
) -> None:
    with tarfile.open(pure[0]) as old, tarfile.open(wheels.packed_source(pure[0], tmp_path)) as new:
        assert new.getnames() == sorted(old.getnames())
        for member in old.getmembers():
            same = new.getmember(member.name)
            assert same.isfile() == member.isfile()
            assert same.mode & 0o100 == (member.mode & 0o100 or member.isdir() << 6)
            if member.isfile():
                assert new.extractfile(same).read() == old.extractfile(member).read()


@pytest.mark.parametrize("platform", wheels.PLATFORMS)
def test_libraries_are_compiled_for_the_platform_and_named_by_their_hash(
    platform: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wheels, "version", lambda _: "1")
    monkeypatch.setattr(wheels, "_name_musl", lambda library, _: library.write_text(MUSL))

    def build(compiler: Compiler, scratch: Path, _log: Path) -> Path:
        (scratch / "library").write_text(" ".join(compiler.command))
        return scratch / "library"

    wanted = recipe("a", "a", [], build)
    ((name, content),) = wheels.compiled([wanted], platform).items()
    assert name == f"{wheels.hash_of(wanted.inputs)}-{wheels.hash_of(content)}.so"
    if platform.startswith("musl"):
        assert content.decode() == MUSL
        return
    assert f"-target {wheels.PLATFORMS[platform]}" in content.decode()
    machine = wheels.PLATFORMS[platform].partition("-")[0]
    assert platform.endswith(machine.replace("aarch64", "arm64" if "mac" in platform else machine))


def test_unknown_platform_is_rejected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        wheels.main([str(tmp_path), "manylinux_x"])
    assert "unknown platform manylinux_x; known: manylinux_2_17" in capsys.readouterr().err


# --- libraries that are shipped -------------------------------------------------------------------


def test_every_option_of_every_device_is_listed_once() -> None:
    found = [(name, *options.items()) for name, options in shipped.choices()]
    assert len(set(found)) == len(found)
    assert ("cubestar",) in found
    assert ("cubestar", ("layout", "2")) in found
    assert ("cubestar", ("firmware", "reference")) in found
    assert ("cubesense", ("mcu_addressing", True)) in found


def test_devices_with_the_same_design_share_a_library() -> None:
    once = shipped.recipes([("cubestar", {})])
    again = shipped.recipes([("cubestar", {}), ("cubestar", {"profile": "extended"})])
    assert [one.inputs for one in once] == [one.inputs for one in again]
    titles = [one.title for one in once if not one.title.startswith("the inner loops")]
    assert titles == ["the FPGA design CubeStarTop"]


@pytest.fixture
def compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler with an empty cache."""
    found = Compiler(("c++",), "c++\nc++ of a test")
    for module in (cache.compilers, shipped):
        monkeypatch.setattr(module, "find_compiler", lambda: found)
    for module in (cache, shipped):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)


@pytest.mark.usefixtures("compiler")
def test_missing_libraries_are_compiled_once(capfd: Any) -> None:
    built, lock = list[str](), threading.Lock()

    def recipe(name: str) -> cache.Recipe:
        def build(_compiler: Compiler, scratch: Path, _log: Path) -> Path:
            with lock:
                built.append(name)
            (scratch / "library").write_text(name)
            return scratch / "library"

        return cache.recipe(name, name, [], build)

    recipes = [recipe(name) for name in "abc"]
    shipped.compile_missing(recipes[:1])
    assert built == ["a"]
    shipped.compile_missing(recipes)
    assert sorted(built) == ["a", "b", "c"]
    capfd.readouterr()
    shipped.compile_missing(recipes)
    assert capfd.readouterr() == ("", "")
    assert len(built) == 3


def test_nothing_is_compiled_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped, "find_compiler", lambda: None)
    monkeypatch.setattr(shipped, "library_of", lambda _: pytest.fail("compiled"))
    shipped.compile_missing([cache.recipe("a", "a", [], lambda *_: Path())])
