import argparse
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.host.cli.commands import commands
from cubestack.host.cli.main import make_parser
from cubestack.host.devices.registry import device_names
from tests.conftest import Run
from tests.together import together

TOLD = re.compile(r"\(?default:? \(?(-?[\d.]+(?:,-?[\d.]+)*)(?![\w.]*[a-z])")


def actions(
    parser: argparse.ArgumentParser, words: str = ""
) -> Iterator[tuple[str, argparse.Action]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                yield from actions(sub, f"{words} {name}".strip())
        else:
            yield f"{words} {'/'.join(action.option_strings) or action.dest}", action


ALL = list(actions(make_parser()))
NUMBERS = [
    (name, action, found[1])
    for name, action in ALL
    if (found := TOLD.search(action.help or "")) and isinstance(action.default, int | float | tuple)
]


def test_help_texts_contain_numeric_defaults() -> None:
    assert len(NUMBERS) > 30


@together(("name", "action", "told"), NUMBERS, ids=[one[0] for one in NUMBERS])
def test_help_text_shows_the_actual_default(name: str, action: argparse.Action, told: str) -> None:
    values = action.default if isinstance(action.default, tuple) else (action.default,)
    assert [float(value) for value in told.rstrip(".").split(",")] == pytest.approx(
        list(values), rel=1e-4
    )


def test_flags_default_to_false() -> None:
    for name, action in ALL:
        if isinstance(action, argparse._StoreTrueAction):
            assert action.default is False, name


ASK = """
source {script}
COMP_WORDS=({words})
COMP_CWORD={last}
$(complete -p cubestack | sed 's/.*-F \\([^ ]*\\).*/\\1/')
echo "${{COMPREPLY[@]}}"
"""


def completed(script: Path, *words: str) -> set[str]:
    text = ASK.format(
        script=script, words=" ".join(f"'{one}'" for one in words), last=len(words) - 1
    )
    call = ["bash", "--norc", "-c", text]
    done = subprocess.run(call, capture_output=True, text=True, check=True, timeout=20)
    return {word.strip() for word in done.stdout.split()}


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes_commands_devices_and_options(run: Run, tmp_path: Path) -> None:
    script = tmp_path / "cubestack"
    script.write_text(run("completion", "bash").out)
    assert completed(script, "cubestack", "me") == {"measure", "memory"}
    assert completed(script, "cubestack", "emulate", "") >= set(device_names())
    assert completed(script, "cubestack", "registers", "cubestar", "--fo") == {"--format"}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_script_is_valid_for_its_shell(shell: str, run: Run, tmp_path: Path) -> None:
    printed = run("completion", shell)
    assert (printed.code, printed.err) == (0, "")
    for name in commands():
        assert name in printed.out
    if shutil.which(shell) is not None:
        (tmp_path / "script").write_text(printed.out)
        subprocess.run([shell, "-n", str(tmp_path / "script")], check=True, timeout=20)


def test_help_of_a_command_with_many_options_is_in_groups(run: Run) -> None:
    shown = run("emulate", "--help").out
    titles = re.findall(r"^([a-z][a-zA-Z ,]+):$", shown, re.M)
    assert [title for title in titles if title != "examples"] == [
        "positional arguments",
        "options",
        "ports",
        "device, its firmware and its FPGA",
        "records",
        "insight into own firmware",
    ]
    listed = run("--help").out
    assert re.findall(r"^  (\w+):$", listed, re.M) == ["Emulator", "Studies", "Tools"]
