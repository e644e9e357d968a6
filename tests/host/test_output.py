"""Files that commands write: a failing start, a second writer and a full disk lose nothing."""

import os
import resource
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.host import output
from cubestack.host.output import Outputs, write_new_folder, write_output, write_outputs

BEFORE = "what was there\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "some.rec"
    path.write_text(BEFORE)
    return path


def alone(path: Path) -> bool:
    """Whether no other file is left in the folder."""
    return os.listdir(path.parent) == [path.name]


def test_failed_start_changes_nothing(path: Path) -> None:
    def start() -> None:
        with Outputs() as outputs:
            outputs.create(path).write("x" * 100_000)
            raise KeyError

    with pytest.raises(KeyError):
        start()
    assert path.read_text() == BEFORE
    assert alone(path)


def test_file_has_its_name_from_keep_on(path: Path) -> None:
    def run() -> None:
        with Outputs() as outputs:
            file = outputs.create(path)
            file.write("a\n")
            assert path.read_text() == BEFORE
            outputs.keep()
            assert path.read_text() == "a\n"
            file.write("b\n")
            raise KeyError

    with pytest.raises(KeyError):
        run()
    assert path.read_text() == "a\nb\n"
    assert alone(path)


@pytest.mark.parametrize("kept", [False, True])
def test_refuses_a_second_writer(path: Path, kept: bool) -> None:
    """In this process or another one."""
    message = f"can not write {path}: it is being written already"
    code = f"import sys; from {output.__name__} import *; write_output(Path(sys.argv[1]), 'b')"
    with Outputs() as outputs:
        outputs.create(path).write("a")
        if kept:
            outputs.keep()
        with pytest.raises(ValueError, match="it is being written already") as raised:
            write_output(path, "b")
        assert str(raised.value) == message
        other = subprocess.run(
            [sys.executable, "-c", code, path], stderr=subprocess.PIPE, text=True
        )
        assert other.stderr.splitlines()[-1] == f"ValueError: {message}"
    assert path.read_text() == "a"
    write_output(path, b"c")
    assert path.read_text() == "c"


def test_file_that_was_kept_meanwhile_is_not_taken_for_a_new_one(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process keeps its file between our opening it and our lock."""
    take = output._take
    rivals = [Outputs()]
    rivals[0].create(path).write("theirs")

    def late(fd: int) -> None:
        if rivals:
            rivals.pop().close()
        take(fd)

    with Outputs() as outputs:
        monkeypatch.setattr(output, "_take", late)
        file = outputs.create(path)
        assert path.read_text() == "theirs"
        file.write("ours")
    assert path.read_text() == "ours"
    assert alone(path)


def test_does_not_replace_a_file_that_appears_meanwhile(tmp_path: Path) -> None:
    path = tmp_path / "new.csv"
    with Outputs() as outputs:
        file = outputs.create(path)
        file.write("ours")
        path.write_text("theirs")
        with pytest.raises(FileExistsError):
            file.keep()
        outputs.pop_all()
        file.end(KeyError, None, None)
    assert path.read_text() == "theirs"
    assert alone(path)


def test_whole_file_that_does_not_fit_is_refused(path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(ValueError, match=r"can not write .*some.rec: File too large"):
            write_output(path, bytes(20_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_text() == BEFORE
    assert alone(path)


def test_keeps_mode_and_link_of_a_replaced_file(path: Path) -> None:
    path.chmod(0o604)
    link = path.with_name("link")
    link.symlink_to(path.name)
    write_output(link, "new")
    assert (path.read_text(), link.is_symlink()) == ("new", True)
    assert stat.S_IMODE(path.stat().st_mode) == 0o604


def test_writes_into_pipes_and_devices(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE, text=True) as reader:
        write_output(pipe, "through")
        assert reader.communicate() == ("through", None)
    write_output(Path("/dev/null"), "away")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


@pytest.mark.parametrize(
    ("name", "reason"), [("none/x", "No such file or directory"), ("", "Is a directory")]
)
def test_path_that_can_not_be_written_is_one_line(tmp_path: Path, name: str, reason: str) -> None:
    with pytest.raises(ValueError, match=f"^can not write .*: {reason}$"):
        write_output(tmp_path / name, "")


def test_files_of_a_folder_are_written_all_or_none(path: Path) -> None:
    with Outputs() as theirs:
        theirs.create(path.with_name("two"))
        with pytest.raises(ValueError, match="it is being written already"):
            write_outputs(path.parent, {path.name: "new", "two": b"new"})
        assert path.read_text() == BEFORE
    write_outputs(path.parent, {path.name: "new", "two": b"new"})
    assert (path.read_text(), path.with_name("two").read_text()) == ("new", "new")


def test_new_folder_appears_whole(path: Path) -> None:
    place = path.parent / "a" / "b"
    write_new_folder(place, {"x": "1", "c/y": b"2"})
    assert (place / "c" / "y").read_text() == "2"
    with pytest.raises(ValueError, match="b exists; remove it"):
        write_new_folder(place, {"x": "3"})
    with pytest.raises(ValueError, match="can not write"):
        write_new_folder(path.parent / "n", {"x": "1", "x/y": "2"})
    assert sorted(os.listdir(path.parent)) == ["a", path.name]
    assert os.listdir(path.parent / "a") == ["b"]


def test_dropped_file_changes_nothing_and_a_kept_one_stays(path: Path) -> None:
    with Outputs() as outputs:
        outputs.create(path).write("new")
        outputs.drop()
    assert path.read_text() == BEFORE
    with Outputs() as outputs:
        outputs.create(path).write("new")
        outputs.keep()
        outputs.drop()
    assert path.read_text() == "new"
    assert alone(path)
