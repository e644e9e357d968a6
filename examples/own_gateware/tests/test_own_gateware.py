"""The changed designs, on the emulated board: as they would be tested in a user's repository."""

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]


def cubestack(*words: str) -> "subprocess.CompletedProcess[str]":
    command = str(Path(sys.executable).with_name("cubestack"))
    return subprocess.run(
        [command, *words], cwd=HERE, capture_output=True, text=True, check=False, timeout=300
    )


@pytest.mark.cocotb
@pytest.mark.parametrize(
    ("design", "more"),
    [
        ("frame_buffer.v", ()),
        pytest.param("parity:Parity", (), marks=pytest.mark.slow),
        pytest.param("binned:Binned", ("--image", "binned"), marks=pytest.mark.slow),
    ],
)
def test_design_fulfils_the_contract(design: str, more: tuple[str, ...], tmp_path: Path) -> None:
    waves = ("--waves", str(tmp_path))
    done = cubestack("hdl", "test", design, "--device", "cubestar", *more, *waves)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "10 passed, 0 failed" in done.stdout
