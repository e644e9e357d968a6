"""Programs that misbehave: each call ends with a result or an errno, and never hangs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.guest_process import Route
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler

from .conftest import build_guest, run_guest

PROGRAM = Path(__file__).with_name("hostile.c")
ROUTES: tuple[Route, ...] = ("seccomp", "preload")
SLOW_HZ = 1000  # 20 bytes take a fifth of a second
TIMEOUT_S = 60

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Linux only"),
    pytest.mark.skipif(find_c_compiler() is None, reason="no C compiler here"),
]

EXPECTED = {
    "pointers": """
        write beyond the end of memory: EFAULT
        read beyond the end of memory: EFAULT
        read into memory that can not be written: EFAULT
        messages beyond the end of memory: EFAULT
        SMBus data beyond the end of memory: EFAULT
        argument beyond the end of memory: EFAULT
        negative pointer: EFAULT
        a call afterwards: 1
    """,
    "huge": """
        I2C_RDWR of 65535 bytes: EINVAL
        42 messages of 65535 bytes: EINVAL
        read of 65535 bytes: 8192
        a call afterwards: 1
    """,
    "closing": """
        close under a call: 0
        the call: 1
        open again: 0
        a call afterwards: 1
        a call after all descriptors were closed under one: 1
    """,
    "signals": """
        call under a signal: 1
        call in its handler: 1
        a call after a jump out of a handler: 1
    """,
    "cancelling": "a call after a thread was cancelled in one: 1",
    "killing": """
        signal that ended a program in a call: 9
        a call afterwards: 1
        exit status of a child born under calls: 0
        calls of other threads: 8
    """,
}
"""What each mode of the program prints, on both routes."""

ORPHANED = {
    "seccomp": "a call whose emulation is killed: ENOSYS\na call afterwards: ENOSYS",
    "preload": "a call whose emulation is killed: EIO\na call afterwards: ENODEV",
}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_guest(PROGRAM, tmp_path_factory.mktemp("hostile"))


def lines(text: str) -> list[str]:
    return [line.strip() for line in text.strip().splitlines()]


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("mode", EXPECTED)
def test_misbehaving_program_gets_results_and_errors(
    program: Path, route: Route, mode: str
) -> None:
    fast = mode in ("pointers", "huge")
    hz, pace = (400_000, "fast") if fast else (SLOW_HZ, "real")
    status, output = run_guest(route, [program, mode], hz=hz, pace=pace, timeout_s=TIMEOUT_S)
    assert (status, lines(output.replace("\t", ": "))) == (0, lines(EXPECTED[mode]))


RUNNER = """
import sys
from tests.emulator.i2cdev.conftest import run_guest
run_guest(sys.argv[1], sys.argv[2:], hz=1000, pace="real", streams=(None, None))
"""


@pytest.mark.slow
@pytest.mark.parametrize("route", ROUTES)
def test_call_fails_if_the_emulation_is_killed(program: Path, route: Route) -> None:
    """The program survives it, with the output of this process."""
    done = subprocess.run(
        [sys.executable, "-c", RUNNER, route, program, "orphaned"],
        stdout=subprocess.PIPE,
        text=True,
        timeout=TIMEOUT_S,
        cwd=Path(__file__).parents[3],
        env=os.environ | {"PYTHONPATH": "."},
    )
    assert lines(done.stdout.replace("\t", ": ")) == lines(ORPHANED[route])
