"""The program of this folder on the emulated board, as a user's CI runs it."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cubestack

FOLDER = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the Makefile builds."""
    if shutil.which("arm-none-eabi-gcc") is None:
        pytest.skip("needs gcc-arm-none-eabi")
    folder = tmp_path_factory.mktemp("picture")
    for name in ("Makefile", "main.c", "picture.ld"):
        shutil.copy(FOLDER / name, folder)
    header = FOLDER.parents[1] / ".venv/bin/cubestack"
    command = str(header) if header.exists() else "cubestack"
    subprocess.run(["make", "-s", f"CUBESTACK={command}"], cwd=folder, check=True)
    return folder / "picture.elf"


@pytest.mark.slow
def test_image_is_stored_by_the_fpga(image: Path) -> None:
    """Sum and brightest pixel are those of the bytes in the FPGA's memory."""
    with cubestack.open_device("cubestar", firmware=str(image)) as cubestar:
        port = cubestar.serial()
        port.timeout = 3
        assert port.read(6) == b"ready\n"
        port.write(b"p")
        answer = b""
        while not answer.endswith(b"\n"):
            answer += port.read()
        stored = cubestar.board.engine.sram[: 512 * 1024]
        brightest = int(np.argmax(stored))
        place = f"{brightest % 1024},{brightest // 1024}"
        told = f"sum {int(stored.sum(dtype=np.uint32))} brightest {stored.max()} at {place}\n"
        assert answer.decode() == told
        port.write(b"x")
        assert port.read(2) == b"?\n"
