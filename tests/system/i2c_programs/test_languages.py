import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.preload.shim import find_c_compiler
from tests.tiers import quick

from ...conftest import Run
from .conftest import TIMEOUT_S, needs_c

CLIENT = Path(__file__).with_name("i2c_client.c")

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


def test_smbus2_program_runs_on_the_emulated_bus(run: Run) -> None:
    assert run(sys.executable, "-c", PYTHON_CLIENT) == (0, "done\n", "")


def test_cube_smbus_finds_the_bus_of_its_environment(run: Run, served: Path) -> None:
    script = (
        "from cubestack.host.transport.smbus import CubeSMBus as B; "
        "print(B(3).read_byte_data(26, 131))"
    )
    options = ("--attach", served, "--bus", 3)
    assert run(sys.executable, "-c", script, options=options) == (0, "1\n", "")


@needs_c
@pytest.mark.parametrize("link", quick(["-static", "-dynamic"], 1))
def test_c_program_reads_the_emulated_i2c_bus(
    run: Run, route: str, tmp_path: Path, link: str
) -> None:
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


def test_random_pointers_crash_neither_emulation_nor_program(run: Run) -> None:
    assert run(sys.executable, "-c", FUZZING_CLIENT, options=("--pace", "fast")).out == "True\n"
