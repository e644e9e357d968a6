import signal
import stat
from pathlib import Path

import pytest

from .blocks import LEFT
from .pasted import Pasted, Shell, left_out, pasted

DOCUMENT = """
```sh
export WORD=kept; cd .
echo $WORD > written; cat written    # a comment
echo why it failed; false
cubestack emulate cubestar --pty ./tty
cubestack shell ./tty --device cubestar
cubestack emulate aramis --firmware program.elf --pty ./tty
cubestack emulate cubesense
make test
```

```python
# saved.py
print("saved")
```

```sh
cat saved.py
cubestack ended
```
"""

CUBESTACK = """#!/usr/bin/env bash
case $1 in
emulate)
    [ $2 = cubesense ] && { echo it does not start; exit 1; }
    trap "echo $2 ended > ended; kill %1; exit 0" INT
    : > tty
    sleep 1000 &
    echo "$2 serves; Ctrl-C ends it"
    wait ;;
ended) cat ended ;;
shell) echo asked ;;
esac
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Pasted]:
    """Results of the document, with a stub of the command."""
    folder = tmp_path_factory.mktemp("reader")
    command = folder / "bin" / "cubestack"
    command.parent.mkdir()
    command.write_text(CUBESTACK, "utf-8")
    command.chmod(command.stat().st_mode | stat.S_IXUSR)
    document = folder / "page.md"
    document.write_text(DOCUMENT, "utf-8")
    ready = [f"PATH={command.parent}:$PATH"]
    found = pasted(document, folder, long=False, limit_s=60.0, ready=ready)
    return {one.line: one for one in found}


def test_lines_share_a_shell_and_report_exit_codes(done: dict[str, Pasted]) -> None:
    codes = {line: one.code for line, one in done.items()}
    assert codes == {
        "export 'WORD=kept;' cd .": 0,
        "echo '$WORD' '>' 'written;' cat written": 0,
        "echo why it 'failed;' false": 1,
        "cubestack emulate cubestar --pty ./tty": 0,
        "cubestack shell ./tty --device cubestar": 0,
        "cubestack emulate aramis --firmware program.elf --pty ./tty": None,
        "cubestack emulate cubesense": 1,
        "make test": None,
        "cat saved.py": 0,
        "cubestack ended": 0,
    }


def test_pasted_command_output_is_reported(done: dict[str, Pasted]) -> None:
    said = {line: one.said for line, one in done.items()}
    assert said["echo '$WORD' '>' 'written;' cat written"] == "kept"
    assert said["echo why it 'failed;' false"].strip() == "why it failed"
    assert said["cubestack shell ./tty --device cubestar"] == "asked"
    assert (
        said["cubestack emulate aramis --firmware program.elf --pty ./tty"]
        == LEFT[r"program\.elf|picture\.elf"]
    )
    assert said["cubestack emulate cubesense"].strip() == "it does not start"
    assert said["cat saved.py"] == 'print("saved")'


def test_server_ends_before_the_next_one_starts(done: dict[str, Pasted]) -> None:
    assert done["cubestack ended"].said == "cubestar ended"


def test_timeout_interrupts_only_the_command(tmp_path: Path) -> None:
    shell = Shell(tmp_path)
    code, said = shell.run("sleep 1000", 0.1)
    assert code == 128 + signal.SIGTERM
    assert said[-1] == "interrupted after 0 s"
    assert shell.run("echo on", 60.0) == (0, ["on", ""])
    shell.close()


@pytest.mark.parametrize("command", ["shell", "ground"])
def test_documented_client_command_is_skipped_without_its_server(
    tmp_path: Path, command: str
) -> None:
    line = f"cubestack {command} ./tty --device cubestar"
    assert "another program serves" in left_out(line, tmp_path, long=False)
    (tmp_path / "tty").touch()
    assert left_out(line, tmp_path, long=False) == ""


@pytest.mark.parametrize("line", ["pip install -e ./glow-sensor", "cubestack ground run.rec"])
def test_lines_that_need_files_of_the_reader_are_skipped(tmp_path: Path, line: str) -> None:
    assert left_out(line, tmp_path, long=False)


@pytest.mark.parametrize("long", [False, True])
def test_long_commands_run_on_demand(tmp_path: Path, long: bool) -> None:
    for line in ("make test-all", "cubestack layouts"):
        assert (left_out(line, tmp_path, long=long) == "") is long
