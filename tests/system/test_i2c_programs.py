"""Unmodified programs on the emulated bus, by both routes: i2c-tools, smbus2, C programs.

What they must print comes from the interface tables.
"""

import errno
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from cubestack.emulator.i2c_host.adapter import I2cAdapter
from cubestack.emulator.i2c_host.pacing import wait_precisely
from cubestack.emulator.i2c_host.server import I2cServer
from cubestack.emulator.i2c_host.shim import find_c_compiler
from cubestack.emulator.ports.pump import Pump
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.cli.boards import open_board
from cubestack.host.cli.main import main

COMMAND = (sys.executable, "-m", "cubestack.host.cli.main", "run")
ENVIRONMENT = os.environ | {"PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin"}
TIMEOUT_S = 120
ROUTES = ("seccomp", "preload")
CLIENT = Path(__file__).with_name("i2c_client.c")

needs_tools = pytest.mark.skipif(
    shutil.which("i2ctransfer", path=ENVIRONMENT["PATH"]) is None, reason="no i2c-tools here"
)
needs_c = pytest.mark.skipif(find_c_compiler() is None, reason="no C compiler here")


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


Run = Callable[..., Outcome]


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The socket of an emulation that runs in this process."""
    path = tmp_path_factory.mktemp("private", numbered=True) / "bus"
    opened = open_board("cubestar", None, seed=0, engine="auto", baud=None)
    board = opened.board
    adapter = I2cAdapter(board.kernel, board.i2c_bus)
    server = I2cServer(path, adapter)
    pump = Pump(
        board.kernel,
        [server],
        lambda: board.busy() or adapter.busy,
        pace="fast",
        wait=wait_precisely,
    )
    thread = threading.Thread(target=pump.run)
    thread.start()
    yield path
    pump.stop()
    thread.join(TIMEOUT_S)
    server.close()
    board.close()


@pytest.fixture(scope="module", params=ROUTES)
def route(request: pytest.FixtureRequest, served: Path) -> str:
    """A route that works here."""
    name = str(request.param)
    found = start("--route", name, "--attach", served, "--", "true")
    if found.code:
        pytest.skip(f"no {name} route here: {found.err.strip()}")
    assert found.err == f"/dev/i2c-7 by way of {name}, as asked\n"
    return name


@pytest.fixture
def run(route: str, served: Path) -> Run:
    """Runs a program with the route, on the served bus or with options of its own."""

    def call(*program: object, options: tuple[object, ...] = ("--attach", served)) -> Outcome:
        return start("--quiet", "--route", route, *options, "--", *program)

    return call


def start(*arguments: object, given: str | None = None) -> Outcome:
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)],
        capture_output=True,
        input=given,
        text=True,
        env=ENVIRONMENT,
        timeout=TIMEOUT_S,
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


# --- i2c-tools ----------------------------------------------------------------------------------


def text(data: bytes) -> str:
    return " ".join(f"{byte:#04x}" for byte in data)


def flags(*names: str) -> str:
    """What telemetry ErrorFlags reads when these are up."""
    message = INTERFACE.telemetry("ErrorFlags")
    return text(message.pack(**message.reset_values() | dict.fromkeys(names, True)))


def thresholds(detection: int, star: int) -> str:
    message = INTERFACE.telemetry("DetectionThresholdValues")
    return text(message.pack(DarkThreshold=0, DetectionThreshold=detection, StarThreshold=star))


def grid(*addresses: int) -> str:
    """What i2cdetect prints when these acknowledge."""
    lines = ["     " + "  ".join(f"{column:x}" for column in range(16))]
    for row in range(0, 0x80, 0x10):
        cells = []
        for address in range(row, row + 0x10):
            if not 0x08 <= address <= 0x77:
                cells.append("  ")
            else:
                cells.append(f"{address:02x}" if address in addresses else "--")
        lines.append(f"{row:02x}: " + " ".join(cells))
    return " ".join(" ".join(lines).split())


IDENTITY = "0x05 0x03 0x00 0x01"
FLAGS = "i2ctransfer -y 7 w1@0x1a 0x82 r10"
SESSION: tuple[tuple[str, int, str | None], ...] = (
    ("i2cdetect -y 7", 0, grid(0x1A)),
    ("i2cdetect -y -q 7", 0, grid(0x1A)),
    ("i2cdetect -y -r 7", 0, grid(0x1A)),
    ("i2cdetect -F 7 | grep -c yes", 0, "15"),
    ("i2cdetect -l | grep -c 'i2c-7.*cubestack'", 0, "1"),
    ("i2cset -y 7 0x1a 0x06", 0, ""),
    (FLAGS, 0, flags()),
    ("i2cget -y 7 0x1a 0x83", 0, "0x01"),
    ("i2cset -y 7 0x1a 0x15 0x1f1f w", 0, ""),
    ("i2cget -y 7 0x1a 0x83", 0, "0x01"),
    ("i2cget -y 7 0x1a 0x92 i 3", 0, thresholds(0x1F, 0x1F)),
    ("i2cset -y 7 0x1a 0x15 0x20 0x21 i", 0, ""),
    ("i2ctransfer -y 7 w1@0x1a 0x92 r3", 0, thresholds(0x20, 0x21)),
    ("i2cget -y 7 0x1a 0x92", 0, "0x00"),
    ("i2cget -y 7 0x1a 0x92 w", 0, "0x2000"),
    ("i2cget -y 7 0x1a 0x88 w", 0, "0x0000"),
    ("i2ctransfer -y 7 w1@0x1a 0x92 r6", 0, thresholds(0x20, 0x21) + " 0xff 0xff 0xff"),
    ("i2ctransfer -y 7 w1@0x1a 0x83 r1 w1 0x92 r3", 0, "0x01 " + thresholds(0x20, 0x21)),
    ("i2cget -y 7 0x1a 0x80 i 4", 0, IDENTITY),
    ("i2ctransfer -y 7 w1@0x1a 0x8f r128 | wc -w", 0, "128"),
    ("i2cget -y 7 0x30 0x83", 2, ""),
    ("i2cset -y 7 0x30 0x06", 1, ""),
    ("i2ctransfer -y 7 w1@0x30 0x83", 1, ""),
    ("i2cget -y 8 0x1a 0x83", 1, ""),
    ("i2cset -y 7 0x1a 0x07 0x01", 0, ""),
    (FLAGS, 0, flags("I2C_TCMD_TooFewParm")),
    ("i2cset -y 7 0x1a 0x06", 0, ""),
    ("i2ctransfer -y 7 r2@0x1a", 0, "0xff 0xff"),
    (FLAGS, 0, flags("I2C_WaitForIDReadRequestError")),
    ("i2cset -y 7 0x1a 0x63", 0, ""),
    ("i2cget -y 7 0x1a 0xfe", 0, "0xff"),
    (FLAGS, 0, flags("I2C_WaitForIDReadRequestError", "TcmdIDError", "TlmIDError")),
    ("i2ctransfer -y 7 w1@0x1a 0x80 r9000", 1, ""),
    ("i2cget -y 7 0x1a 0x92 s", 2, ""),  # its first byte, 0, is no length of a block
    ("i2cdump -y -r 0x92-0x92 7 0x1a b | grep -c '^90: *00'", 0, "1"),
)


@needs_tools
def test_a_session_with_i2c_tools(run: Run, tmp_path: Path) -> None:
    script = tmp_path / "session.sh"
    script.write_text(
        "set -o pipefail\n"
        + "".join(f"output=$({line} 2>/dev/null); echo $?: $output\n" for line, _, _ in SESSION)
        + "exit 42\n"
    )
    outcome = run("bash", script, options=("--pace", "fast"))
    assert outcome.code == 42
    answers = outcome.out.splitlines()
    assert len(answers) == len(SESSION)
    for (line, code, expected), answer in zip(SESSION, answers, strict=True):
        assert (line, answer.strip()) == (line, f"{code}: {expected}".strip())


# --- smbus2 -------------------------------------------------------------------------------------

PYTHON_CLIENT = """
import errno, os, stat
from smbus2 import SMBus, i2c_msg
found = os.stat("/dev/i2c-7")
assert stat.S_ISCHR(found.st_mode) and (os.major(found.st_rdev), os.minor(found.st_rdev)) == (89, 7)
with SMBus(7) as bus:
    assert bus.read_byte_data(0x1A, 0x83) == 1
    bus.write_i2c_block_data(0x1A, 0x15, [0x40, 0x41])
    while not bus.read_byte_data(0x1A, 0x83): pass
    assert bus.read_i2c_block_data(0x1A, 0x92, 4) == [0, 0x40, 0x41, 0xFF]
    assert bus.read_word_data(0x1A, 0x92) == 0x4000
    write, read = i2c_msg.write(0x1A, [0x92]), i2c_msg.read(0x1A, 8192)
    bus.i2c_rdwr(write, read)
    assert bytes(read) == bytes([0, 0x40, 0x41]) + b"\\xff" * 8189
    bus.write_quick(0x1A)
    for address, size, code in ((0x30, 1, errno.ENXIO), (0x1A, 8193, errno.EINVAL)):
        try:
            bus.i2c_rdwr(i2c_msg.read(address, size))
        except OSError as error:
            assert error.errno == code, error
        else:
            raise AssertionError(f"{address:#x}, {size}: no error")
with open("/dev/i2c-7", "r+b", buffering=0) as first, SMBus("/dev/i2c-7") as second:
    import fcntl
    fcntl.ioctl(first, 0x0703, 0x1A)
    second.write_byte(0x1A, 0x92)
    assert first.read(3) == bytes([0, 0x40, 0x41])
    assert first.write(b"\\x92") == 1
    child = os.fork()
    if not child:
        os._exit(first.read(3)[1])
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0x40
print("done")
"""


def test_smbus2(run: Run) -> None:
    assert run(sys.executable, "-c", PYTHON_CLIENT) == (0, "done\n", "")


def test_cube_smbus_finds_the_bus_around_it(run: Run, served: Path) -> None:
    script = "from cubestack.host.smbus import CubeSMBus as B; print(B(3).read_byte_data(26, 131))"
    options = ("--attach", served, "--bus", 3)
    assert run(sys.executable, "-c", script, options=options) == (0, "1\n", "")


# --- C ------------------------------------------------------------------------------------------


@needs_c
@pytest.mark.parametrize("link", ["-static", "-dynamic"])
def test_a_c_program(run: Run, route: str, tmp_path: Path, link: str) -> None:
    program = tmp_path / "client"
    compiler = find_c_compiler()
    assert compiler is not None
    options = [link] if link == "-static" else []
    command = [*compiler, *options, "-o", program, CLIENT]
    built = subprocess.run(command, capture_output=True, timeout=TIMEOUT_S)
    if built.returncode and link == "-static":
        pytest.skip("no static C library here")
    assert built.returncode == 0, built.stderr
    outcome = run(program)
    if (route, link) == ("preload", "-static"):
        assert outcome.code == 1
        assert "is linked statically, so no library can be loaded into it" in outcome.err
        return
    assert (outcome.out, outcome.err, outcome.code) == ("all as on Linux\n", "", 17)


# --- the command --------------------------------------------------------------------------------


@needs_tools
def test_options_of_the_bus(run: Run, tmp_path: Path) -> None:
    script = tmp_path / "session.sh"
    python = (
        "import smbus2\ntry: smbus2.SMBus(12).read_byte(26)\nexcept OSError as e: print(e.errno)"
    )
    script.write_text(f"i2cdetect -y 12\ni2cget -y 12 0x2b 0x83\n{sys.executable} -c '{python}'\n")
    devices = ("--device", "cubestar", "--device", "cubesense", "--i2c-addr", "cubestar=0x2b")
    options = ("--bus", 12, "--nack-errno", "EREMOTEIO", "--hz", 400_000, *devices)
    *detected, value, error = run("sh", script, options=options).out.splitlines()
    assert " ".join(" ".join(detected).split()) == grid(0x1B, 0x1C, 0x2B)
    assert (value, error) == ("0x01", "121")


def test_faults_of_the_bus_reach_the_program(run: Run, tmp_path: Path) -> None:
    plan = tmp_path / "faults.toml"
    plan.write_text('seed = 1\n[[fault]]\nkind = "i2c-stretch"\nstretch_us = 2e6\n')
    script = "import smbus2\ntry: smbus2.SMBus(7).read_byte(26)\nexcept OSError as e: print(e)"
    outcome = run(sys.executable, "-c", script, options=("--pace", "fast", "--faults", plan))
    assert outcome.out == f"[Errno {errno.ETIMEDOUT}] Connection timed out\n"


def test_exit_codes_and_streams(route: str, served: Path) -> None:
    script = "read line; echo out $line; echo err >&2; exit 7"
    options = ("--quiet", "--route", route, "--attach", served)
    outcome = start(*options, "--", "sh", "-c", script, given="in\n")
    assert outcome == (7, "out in\n", "err\n")


def test_a_program_that_a_signal_ends(run: Run) -> None:
    assert run("sh", "-c", "kill -TERM $$").code == 128 + 15


def test_a_program_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--", "no-such-program"]) == 2
    assert "no-such-program: no such program" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["cubestarr=0x2a", "0x1a", "0x1a=", "cubestar=x", "0x1a=0x2a=3"])
def test_a_move_that_makes_no_sense(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as raised:
        main(["run", "--i2c-addr", text, "--", "true"])
    assert raised.value.code == 2
    assert "is not NAME=0xNN, as in cubestar=0x2a" in capsys.readouterr().err


def test_attached_to_nobody(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--attach", str(tmp_path / "bus"), "--", "true"]) == 1
    assert "no emulation serves" in capsys.readouterr().err


def test_preload_takes_over_where_seccomp_is_refused(route: str, served: Path) -> None:
    """A process under a listener gets no second one, as in a container that refuses it."""
    if route != "seccomp":
        pytest.skip("needs a filter around it")
    inner = [*COMMAND, "--bus", "8", "--attach", str(served), "--", "cat", "/proc/bus/i2c"]
    outcome = start("--quiet", "--route", "seccomp", "--attach", served, "--", *inner)
    assert outcome.code == 0
    assert outcome.out.startswith("i2c-7")  # cat does not use fopen, so the outer one answers
    assert "by way of preload, as seccomp is not there: the kernel refuses" in outcome.err


def test_processes_left_behind_are_served(run: Run, route: str, tmp_path: Path) -> None:
    """Under a filter they would fail without their supervisor."""
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


def test_a_signal_to_the_command_goes_to_the_program(route: str, served: Path) -> None:
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


PACED_CLIENT = """
import time
from smbus2 import SMBus, i2c_msg
times = []
with SMBus(7) as bus:
    for _ in range(5):
        started = time.perf_counter()
        bus.i2c_rdwr(i2c_msg.read(0x1A, 8192))
        times.append(time.perf_counter() - started)
print(min(times))
"""


def test_paced_transfers_take_their_time_on_the_wire(run: Run) -> None:
    """The quickest of a few: others may use the machine as well."""
    wire_s = (1 + 9 + 9 * 8192 + 1) / 400_000
    outcome = run(sys.executable, "-c", PACED_CLIENT, options=("--hz", 400_000))
    assert float(outcome.out) == pytest.approx(wire_s, rel=0.05)


FUZZING_CLIENT = """
import ctypes, os, random
from smbus2 import SMBus
random.seed(7)
call = ctypes.CDLL(None, use_errno=True).syscall
IOCTL = 16 if os.uname().machine == "x86_64" else 29
buffer = ctypes.create_string_buffer(random.randbytes(4096))
good = ctypes.addressof(buffer)
with SMBus(7) as bus:
    for _ in range(1000):
        near = good + random.randrange(4000)
        pointer = random.choice([0, 1, 8, 0x1000, 2**47, 2**64 - 1, good, near])
        number = random.choice([*range(0x0700, 0x070A), 0x0720])
        call(IOCTL, bus.fd, number, ctypes.c_ulong(pointer))
with SMBus(7) as bus:
    print(bus.read_byte_data(0x1A, 0x83) in (0, 1))
"""


def test_no_pointers_harm_the_supervisor(run: Run, route: str) -> None:
    if route != "seccomp":
        pytest.skip("a library follows the pointers of its program, and dies with it")
    assert run(sys.executable, "-c", FUZZING_CLIENT, options=("--pace", "fast")).out == "True\n"
