import shutil
import subprocess
from pathlib import Path

import pytest

from cubestack.host.cli.commands import commands
from cubestack.host.devices.registry import device_names
from tests.conftest import Run

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
