"""A minute of `make fuzz`, and that it finds what is wrong."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz import run
from tests.fuzz.readers import FILE, READERS, Reader

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_some_seconds_of_nearly_right_documents(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.fuzz.run", "--minutes", "1", "--seeds", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr[-5000:]
    assert " 0 failures" in done.stdout


@pytest.mark.parametrize("name", READERS)
def test_documents_are_accepted(name: str, tmp_path: Path) -> None:
    """At least one is; the others are rejected in one line."""
    watch = run.Watch()
    outcomes = set()
    for document in READERS[name].documents:
        outcome, wrong = run.judged(name, READERS[name], document, tmp_path, watch)
        assert wrong is None
        outcomes.add(outcome)
    assert "accepted" in outcomes


def divide(folder: Path) -> None:
    _ = 1 / len((folder / FILE).read_bytes().strip(b"x"))


def shout(_folder: Path) -> None:
    raise ValueError("two\nlines")


def reach(_folder: Path) -> None:
    Path("/etc/hostname").read_bytes()


def spin(_folder: Path) -> None:
    for _ in range(10**9):
        if run.time.process_time() > _begin_s + run.LONGEST_S:
            return


_begin_s = 0.0


@pytest.mark.parametrize(
    ("read", "wrong"),
    [(divide, "ZeroDivisionError"), (shout, "no line of text"), (reach, "it opened")],
)
def test_faults_of_a_reader_are_found(read, wrong, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    _, told = run.judged("x", Reader(read, ()), b"xxx", tmp_path, run.Watch())
    assert told is not None
    assert wrong in told


def test_slow_readers_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LONGEST_S", 0.05)
    monkeypatch.setitem(globals(), "_begin_s", run.time.process_time() + 0.05)
    _, told = run.judged("x", Reader(spin, ()), b"", tmp_path, run.Watch())
    assert told is not None
    assert "it took" in told
