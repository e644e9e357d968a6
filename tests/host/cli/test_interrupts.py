"""Ctrl-C at any moment of a command, also while Python and its modules are loaded."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import pytest

from cubestack.host.cli import start
from cubestack.host.cli.start import deliver_again
from tests.tiers import quick_ones, todays

SCRIPT = Path(__file__).parents[3] / "host" / "cli" / "cubestack"
ENV = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
ENDED_S = 60.0

COMMANDS = (
    "--version",
    "measure cubestar --frames 500",
    "measure aramis --frames 500",
    "emulate cubesense --tcp 0",
    "registers cubestar",
    "export cubestar --format xtce",
    "shell emulated:cubestar -c list",
    "conformance emulated:aramis",
    "catalogue cubestar",
    "hdl area cubestar",
)
MOMENTS, TURNS = 50, 4
CASES = [(words, turn) for words in COMMANDS for turn in range(TURNS)]
QUICK = [(words, at % TURNS) for at, words in enumerate(COMMANDS) if at % 4 == 1]


def test_ctrl_c_in_a_finalizer_is_not_lost() -> None:
    again = Event()
    before = signal.signal(signal.SIGINT, lambda _number, _frame: again.set())
    try:
        deliver_again(SimpleNamespace(exc_type=KeyboardInterrupt))  # type: ignore[arg-type]
        assert again.wait(ENDED_S)
    finally:
        signal.signal(signal.SIGINT, before)


def _heard() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # nohup or a script's & would ignore it


def _can_block() -> bool:
    env = shutil.which("env") or ""
    return subprocess.run([env, "--block-signal=INT", "true"], capture_output=True).returncode == 0


@pytest.mark.skipif(not _can_block(), reason="this env can not block signals")
@pytest.mark.parametrize(("words", "turn"), quick_ones(CASES, *QUICK))
def test_ctrl_c_ends_the_command_in_order(words: str, turn: int, tmp_path: Path) -> None:
    last_s = 0.4 if words.startswith("-") else 1.5
    after_s = todays(turn, TURNS, MOMENTS) / MOMENTS * last_s
    print(f"after {after_s} s")
    call = [SCRIPT, *words.split()]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        call, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, cwd=tmp_path, env=ENV,
        text=True, preexec_fn=_heard,
    ) as process:  # fmt: skip
        try:
            _, said = process.communicate(timeout=after_s)
        except subprocess.TimeoutExpired:
            # On a loaded machine it may have ended before this is reached.
            pipes = (process.stdout, process.stderr)
            finished = all(one is not None and one.closed for one in pipes)
            finished = finished or process.poll() is not None
            if not finished:
                process.send_signal(signal.SIGINT)
            told, said = process.communicate(timeout=ENDED_S)
            ends_well = finished or "Ctrl-C ends it" in said
            if process.returncode == 0 and not ends_well:  # too late, but nothing may be missing
                undisturbed = subprocess.run(
                    call, stdin=subprocess.DEVNULL, capture_output=True, cwd=tmp_path, env=ENV,
                    text=True,
                )  # fmt: skip
                ends_well = told == undisturbed.stdout
            # A shell shows 130, too, for one that the signal ends before the script's first line.
            assert process.returncode in ((0,) if ends_well else (130, -signal.SIGINT)), said
    assert "Traceback" not in said
    assert "KeyboardInterrupt" not in said


@pytest.mark.parametrize("hides", ["raises", "returns 2"])
def test_ctrl_c_that_another_error_hides_ends_with_its_status(
    hides: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(on_start: Callable[[], object]) -> int:
        on_start()
        try:

            class Named:
                def __set_name__(self, _owner: type, _name: str) -> None:
                    signal.raise_signal(signal.SIGINT)

            type("Owner", (), {"member": Named()})
        except RuntimeError:
            if hides == "raises":
                raise
        return 2

    monkeypatch.setattr("cubestack.host.cli.main.main", run)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert start.main() == start.INTERRUPTED
    finally:
        signal.signal(signal.SIGINT, before)
