import subprocess
import sys

import pytest

from cubestack.host.errors import install_command
from tests.tiers import quick

CONTROLLED = ["emulate", "cubestar", "--tcp", "0", "--control", "0"]


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (["emulated:cubestar", "--scene", "/none.toml"], "/none.toml"),
        (["/dev/nothing", "--device", "cubestar"], "/dev/nothing"),
    ],
)
def test_missing_file_or_port_is_named(words: list[str], file: str) -> None:
    call = [sys.executable, "-m", "cubestack", "ground", *words]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1
    assert file in ended.stderr.splitlines()[-1]


@pytest.mark.parametrize("missing", quick(["starlette", "uvicorn", "websockets"], 1))
@pytest.mark.parametrize("words", [["ground", "emulated:cubestar"], CONTROLLED])
def test_missing_dependency_names_the_extra(words: list[str], missing: str) -> None:
    text = (
        f"import sys; sys.modules['{missing}'] = None; from cubestack.host.cli.main import main; "
        f"sys.exit(main({words}))"
    )
    call = [sys.executable, "-c", text]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2
    assert ended.stderr.endswith(f"this needs {missing}: {install_command('ground')}\n")
