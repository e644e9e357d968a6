import os
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.host.cli.commands import commands

from ...conftest import Run

FAILED, WRONG_CALL = 1, 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("decode", "{folder}/none.rec"), "{folder}/none.rec: No such file or directory"),
        (("replay", "{folder}"), "{folder}: Is a directory"),
        (("demo", "--out", "/proc/cubestack"), "/proc/cubestack: No such file or directory"),
        (
            ("measure", "cubestar", "--scene", "{folder}"),
            "{folder} can not be read: Is a directory",
        ),
        (("measure", "cubestar", "--firmware", "{folder}"), "{folder}: Is a directory"),
        (
            ("shell", "/dev/ttyNONE", "--device", "cubestar"),
            "can not open /dev/ttyNONE: No such file or directory",
        ),
        (
            ("shell", "/dev/null", "--device", "cubestar"),
            "can not open /dev/null: it is no serial port (Inappropriate ioctl for device)",
        ),
        (
            ("emulate", "aramis", "--pty", "{folder}/none/tty"),
            "can not create the link {folder}/none/tty: No such file or directory",
        ),
        (
            ("emulate", "aramis", "--tcp", "0", "--listen", "192.0.2.1", "--allow-remote"),
            "can not listen on 192.0.2.1:0: Cannot assign requested address; choose another port",
        ),
        (
            ("emulate", "aramis", "--control", "0", "--listen", "0.0.0.0"),
            "0.0.0.0 can be reached from other machines: take 127.0.0.1, or give --allow-remote",
        ),
        (
            ("emulate", "aramis", "--listen", "0.0.0.0"),
            "--listen: of which port? It goes with --tcp, --rfc2217 or --control",
        ),
    ],
)
def test_error_is_one_plain_line(
    run: Run, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    outcome = run(*(word.format(folder=tmp_path) for word in words))
    assert outcome.code in (FAILED, WRONG_CALL)
    assert outcome.line == f"cubestack {words[0]}: {said.format(folder=tmp_path)}"


def process(text: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """A Python process that runs ``text``."""
    return subprocess.run(
        [sys.executable, "-c", text],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, **environment},
    )


@pytest.mark.parametrize("quiet", [(), ("-q",)])
def test_missing_compiler_prints_what_to_install(tmp_path: Path, quiet: tuple[str, ...]) -> None:
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
            "ziglang); using the Amaranth simulator, about a thousand times slower"
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


@pytest.mark.parametrize("words", [("registers", "cubesense"), ("measure", "cubesense")])
def test_commands_run_in_an_ascii_locale(words: tuple[str, ...]) -> None:
    done = process(f"from cubestack.host.cli.main import main; main({list(words)})", **ASCII)
    assert done.returncode == 0, done.stderr
    assert done.stdout


@pytest.mark.parametrize("command", commands())
def test_help_links_to_the_documents_it_names(run: Run, command: str) -> None:
    shown = run(command, "--help").out
    assert ("docs/" in shown) == ("\ndocs/: https://" in shown)
    assert "docs/" in shown or command != "emulate"
