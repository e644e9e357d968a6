import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tiers import quick

SOON_S = 60.0
CALL = [sys.executable, "-m", "cubestack"]


def begun(*words: str) -> "subprocess.Popen[str]":
    pipe = subprocess.PIPE
    call = [*CALL, *words]
    return subprocess.Popen(call, stdout=pipe, stderr=pipe, text=True, preexec_fn=heard)


def heard() -> None:
    """Restores the handlers that nohup or a script's & would ignore."""
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat").read_text("utf-8").rpartition(")")[2].split()[0]
    return state != "Z"


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
def test_signal_removes_the_pty_link(number: signal.Signals, tmp_path: Path) -> None:
    link = tmp_path / "tty"
    with begun("emulate", "cubestar", "--pty", str(link)) as process:
        assert process.stderr is not None
        while "serves on" not in (line := process.stderr.readline()):
            assert line
        assert link.is_symlink()
        process.send_signal(number)
        process.communicate(timeout=SOON_S)
    assert not link.is_symlink()
    assert process.returncode == (128 + number if number is signal.SIGHUP else 0)


@pytest.mark.parametrize("number", quick([signal.SIGKILL, signal.SIGTERM], 1))
@pytest.mark.parametrize("words", [("ground", "emulated:cubestar"), ("demo", "--out", "{folder}")])
def test_signal_ends_the_emulation_process(
    words: tuple[str, ...], number: signal.Signals, tmp_path: Path
) -> None:
    with begun(*(word.format(folder=tmp_path) for word in words)) as process:
        assert process.stderr is not None
        while "Ctrl-C" not in (line := process.stderr.readline()):
            assert line
        (child,) = children(process.pid)
        process.send_signal(number)
        process.wait(SOON_S)
        if alive(child):  # its end is something to wait for
            waiting = os.pidfd_open(child)
            assert select.select([waiting], [], [], SOON_S)[0]
            os.close(waiting)
    assert not alive(child)


def children(process: int) -> set[int]:
    """Child processes of all threads of ``process``."""
    tasks = Path(f"/proc/{process}/task").glob("*/children")
    return {int(one) for task in tasks for one in task.read_text("utf-8").split()}


@pytest.mark.slow
def test_interrupt_shows_the_measurements_so_far() -> None:
    with begun("measure", "cubestar", "--frames", "5000", "--threshold", "25") as process:
        assert process.stderr is not None
        while " of 5000, " not in (line := process.stderr.readline()):
            assert line
        process.send_signal(signal.SIGINT)
        shown, told = process.communicate(timeout=SOON_S)
    assert process.returncode == 128 + signal.SIGINT
    assert "stopped after " in told
    assert "frames" in shown or "%" in shown
