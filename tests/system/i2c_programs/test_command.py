import errno
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.scheduler import MAX_DEBT_NS
from cubestack.host.cli.main import main
from tests.tiers import quick

from ...conftest import Run
from .conftest import COMMAND, TIMEOUT_S, start


def test_i2c_fault_plan_reaches_the_guest_program(run: Run, tmp_path: Path) -> None:
    plan = tmp_path / "faults.toml"
    plan.write_text('seed = 1\n[[fault]]\nkind = "i2c-stretch"\nstretch_us = 2e6\n')
    script = "import smbus2\ntry: smbus2.SMBus(7).read_byte(26)\nexcept OSError as e: print(e)"
    outcome = run(sys.executable, "-c", script, options=("--pace", "fast", "--faults", plan))
    assert outcome.out == f"[Errno {errno.ETIMEDOUT}] Connection timed out\n"


def test_run_passes_exit_status_and_streams_through(route: str, served: Path) -> None:
    """A program ended by a signal, too, has an exit status."""
    script = "read line; echo out $line; echo err >&2; kill -TERM $$"
    options = ("--quiet", "--route", route, "--attach", served)
    outcome = start(*options, "--", "sh", "-c", script, given="in\n")
    assert outcome == (128 + 15, "out in\n", "err\n")


MOVES = ("cubestarr=0x2a", "0x1a", "0x1a=", "cubestar=x", "0x1a=0x2a=3")


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        ("-- no-such-program", 2, "no-such-program: no such program"),
        ("--attach no/bus -- true", 1, "no emulation serves"),
        *((f"--i2c-addr {move} -- true", 2, "is not NAME=0xNN, as in") for move in MOVES),
    ],
)
def test_rejects_programs_and_buses_that_do_not_exist(
    arguments: str, code: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match=str(code)):
        sys.exit(main(["run", *arguments.split()]))
    assert text in capsys.readouterr().err


def test_preload_is_used_where_seccomp_is_unavailable(route: str, served: Path) -> None:
    """A process under a seccomp listener gets no second one, as in some containers."""
    if route != "seccomp":
        pytest.skip("needs a filter around it")
    inner = [*COMMAND, "--bus", "8", "--attach", str(served), "--", "cat", "/proc/bus/i2c"]
    outcome = start("--quiet", "--route", "seccomp", "--attach", served, "--", *inner)
    assert outcome.code == 0
    assert outcome.out.startswith("i2c-7")  # cat does not use fopen, so the outer one answers
    assert "is served by preload, as seccomp is not available: the kernel refuses" in outcome.err


def test_child_processes_are_served_after_the_program_ends(
    run: Run, route: str, tmp_path: Path
) -> None:
    """Without their supervisor, filtered system calls would fail."""
    result = tmp_path / "result"
    script = (
        "import os, smbus2\n"
        "read, write = os.pipe()\n"
        "if not os.fork():\n"
        "    os.close(write); os.read(read, 1)\n"  # until the parent has ended
        f"    open({str(result)!r}, 'w').write(str(smbus2.SMBus(7).read_byte_data(26, 131)))\n"
        "os._exit(5)\n"
    )
    assert run(sys.executable, "-c", script).code == 5
    if route == "seccomp":
        assert result.read_text() == "1"


def test_signal_is_forwarded_to_the_program(route: str, served: Path) -> None:
    script = "trap 'exit 33' TERM; echo ready; read line"
    options = ("--quiet", "--route", route, "--attach", str(served))
    with subprocess.Popen(
        [*COMMAND, *options, "--", "sh", "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        watch = threading.Timer(TIMEOUT_S, process.kill)
        watch.start()
        assert process.stdout.readline() == b"ready\n"
        watch.cancel()
        process.terminate()
        assert process.wait(TIMEOUT_S) == 33


CLIENT = """
import sys, time
from smbus2 import SMBus, i2c_msg
marks = []
with SMBus(7) as bus:
    for _ in range(16):
        {}
        marks.append(time.perf_counter())
print(*(after - before for before, after in zip(marks, marks[1:])))
"""
BYTE_READS = 20
BYTES = f"for _ in range({BYTE_READS}): bus.read_byte_data(0x1A, 0x83)"
BYTES_BITS = BYTE_READS * (2 * (1 + 9 + 9) + 1)
LONG = "bus.i2c_rdwr(i2c_msg.read(0x1A, 600))"
LONG_BITS = 1 + 9 + 9 * 600 + 1
CASES = [(100_000, BYTES, BYTES_BITS), (400_000, LONG, LONG_BITS), (400_000, BYTES, BYTES_BITS)]


@pytest.mark.parametrize(
    ("hz", "calls", "bits"), quick(CASES, 1), ids=["bytes-100k", "long-400k", "bytes-400k"]
)
def test_transfers_take_their_wire_time(run: Run, hz: int, calls: str, bits: int) -> None:
    """Of single bytes: tests/emulator/i2cdev/test_scheduler.py, in virtual time."""
    outcome = run(sys.executable, "-c", CLIENT.format(calls), options=("--hz", hz))
    assert outcome.code == 0, outcome.err
    times = sorted(map(float, outcome.out.split()))
    wire_s = bits / hz
    assert sum(times) > len(times) * wire_s - MAX_DEBT_NS / 1e9
    if calls == LONG:  # much longer than any work for it
        assert times[0] < 1.5 * wire_s
