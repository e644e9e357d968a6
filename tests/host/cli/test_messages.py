import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.host.errors import install_command
from tests.forked import command, forked
from tests.tiers import quick

CALL = [sys.executable, "-m", "cubestack"]


def process(text: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """A Python process that runs ``text``."""
    return subprocess.run(
        [sys.executable, "-c", text],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, **environment},
    )


@pytest.mark.parametrize("quiet", quick([[], ["-q"]], 1))
def test_missing_compiler_prints_what_to_install(tmp_path: Path, quiet: list[str]) -> None:
    words = [*quiet, "shell", "emulated:cubestar", "-c", "read Identification"]
    text = (
        "import cubestack.emulator.native.compiler as k\n"
        "from cubestack.host.cli.main import main\n"
        "k.find_compiler = lambda: None\n"
        f"raise SystemExit(main({words}))"
    )
    done = process(text, XDG_CACHE_HOME=str(tmp_path))
    assert done.returncode == 0
    assert "NodeType" in done.stdout
    told = [line for line in done.stderr.splitlines() if not line.startswith("opening ")]
    assert told == (
        []
        if quiet
        else [
            "cubestack shell: no C++ compiler found (install g++ or clang++, or run: pip install "
            f"ziglang); {what}"
            for what in (
                "using the Amaranth simulator, about a thousand times slower",
                "inner loops run in Python, which takes longer",
            )
        ]
    )


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def test_ascii_locale_replaces_other_characters() -> None:
    text = (
        "import sys\n"
        "from cubestack.host.cli import main\n"
        "from cubestack.host.studies import demo\n"
        "from cubestack.host.terminal import head, say, tell\n"
        "def run(_args):\n"
        "    print(sys.stdout.encoding)\n"
        "    head('1\\xb0'); tell('+20.08\\xb0 \\u2014'); say('5 \\xb5s')\n"
        "demo.run = run; sys.argv = ['cubestack', 'demo']; sys.exit(main.main())"
    )
    done = process(text, **ASCII)
    assert (done.returncode, done.stderr) == (0, "5 ?s\n")
    encoding, *shown = done.stdout.splitlines()
    assert "utf" not in encoding.lower()
    assert shown == ["== 1? ==", "+20.08? ?"]


@pytest.mark.parametrize("command", quick(["registers", "measure"], 1))
def test_commands_run_in_an_ascii_locale(command: str) -> None:
    call = f"main([{command!r}, 'cubesense'])"
    done = process(f"from cubestack.host.cli.main import main; {call}", **ASCII)
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize(
    ("words", "file"),
    quick(
        [
            (["/dev/nothing", "--device", "cubestar"], "/dev/nothing"),
            (["emulated:cubestar", "--scene", "/none.toml"], "/none.toml"),
        ],
        1,
    ),
)
def test_missing_file_or_port_is_named(words: list[str], file: str) -> None:
    ended = forked(command("ground", *words))
    assert ended.code == 1
    assert file in ended.err.splitlines()[-1]


CONTROLLED = ["emulate", "cubestar", "--tcp", "0", "--control", "0"]


@pytest.mark.parametrize("missing", quick(["starlette", "uvicorn", "websockets"], 1))
@pytest.mark.parametrize("words", quick([["ground", "emulated:cubestar"], CONTROLLED], 1))
def test_missing_dependency_names_the_extra(words: list[str], missing: str) -> None:
    ended = process(
        f"import sys; sys.modules['{missing}'] = None; from cubestack.host.cli.main import main; "
        f"sys.exit(main({words}))"
    )
    assert ended.returncode == 2
    assert ended.stderr.endswith(f"this needs {missing}: {install_command('ground')}\n")


SOON_S = 60.0

ENDED = [["ground", "emulated:cubestar"], ["demo", "--out", "{folder}"]]
"""Commands that start an emulation in another process."""


def begun(until: str, *words: str) -> "subprocess.Popen[str]":
    """A command that has printed ``until``."""
    pipe = subprocess.PIPE
    call = [*CALL, *words]
    process = subprocess.Popen(call, stdout=pipe, stderr=pipe, text=True, preexec_fn=heard)
    assert process.stderr is not None
    while until not in (line := process.stderr.readline()):
        assert line
    return process


def heard() -> None:
    """Restores the handlers that nohup or a script's & would ignore."""
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize("number", quick([signal.SIGHUP, signal.SIGTERM, signal.SIGINT], 1))
def test_signal_removes_the_pty_link(number: signal.Signals, tmp_path: Path) -> None:
    link = tmp_path / "tty"
    with begun("serves on", "emulate", "cubestar", "--pty", str(link)) as process:
        assert link.is_symlink()
        assert link.is_char_device()
        process.send_signal(number)
        process.communicate(timeout=SOON_S)
    assert not link.is_symlink()
    assert process.returncode == (128 + number if number is signal.SIGHUP else 0)


@pytest.mark.parametrize("number", quick([signal.SIGKILL, signal.SIGTERM], 1))
@pytest.mark.parametrize("words", quick(ENDED, 1))
def test_signal_ends_the_emulation_process(
    words: list[str], number: signal.Signals, tmp_path: Path
) -> None:
    with begun("Ctrl-C", *(word.format(folder=tmp_path) for word in words)) as process:
        (child,) = children(process.pid)
        ending = os.pidfd_open(child)  # readable once the process has ended
        process.send_signal(number)
        process.wait(SOON_S)
        assert select.select([ending], [], [], SOON_S)[0]
        os.close(ending)


def children(process: int) -> set[int]:
    """Child processes of all threads of ``process``."""
    tasks = Path(f"/proc/{process}/task").glob("*/children")
    return {int(one) for task in tasks for one in task.read_text("utf-8").split()}


@pytest.mark.slow
def test_interrupt_shows_the_measurements_so_far() -> None:
    with begun(
        " of 5000, ", "measure", "cubestar", "--frames", "5000", "--threshold", "25"
    ) as process:
        process.send_signal(signal.SIGINT)
        shown, told = process.communicate(timeout=SOON_S)
    assert process.returncode == 128 + signal.SIGINT
    assert "stopped after " in told
    assert "frames" in shown or "%" in shown
