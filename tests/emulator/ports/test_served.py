"""The ports served by the scheduler, for programs that know nothing of us, and for bad clients.

``tests/system/test_bad_clients.py`` does the latter to the command, in wall time.
"""

import contextlib
import os
import shutil
import socket
import subprocess
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import serial

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.ports.serial_port import MAX_UNREAD, MAX_UNSENT
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats import i2c_socket, linux_i2c

from ..bus.ends import Memory
from ..i2cdev.conftest import GREETING, packed
from .conftest import ALL_BYTES, TIMEOUT_S, Client, Device, Wall, open_client, open_port, served

# pyserial calls setDaemon and setName of a thread.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")

MESSAGE = bytes(byte for byte in range(256) if byte not in (0x01, 0x0A, 0x0D))
"""Without picocom's escape (C-a) and line ends."""

a_pty = pytest.mark.parametrize("kind", ["pty"])


@pytest.mark.parametrize("pace", ["real", "fast"])
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("pty", {"baudrate": 57_600, "exclusive": True}),
        ("tcp", {}),
        ("rfc2217", {"baudrate": 1_000_000}),
    ],
)
def test_pyserial_exchanges_all_bytes_on_each_port_kind(port, device, pace, options):
    device.answers = 1
    url = port.name.replace("tcp:", "socket:")
    with served(device, port, pace):
        for round_ in range(3):
            with serial.serial_for_url(url, timeout=TIMEOUT_S, **options) as client:
                message = ALL_BYTES + bytes([round_])
                client.write(message)
                assert client.read(len(message)) == message


@a_pty
@pytest.mark.parametrize("pace", ["real", "fast"])
def test_pty_echoes_all_bytes_to_a_plain_file_object(port, device, pace):
    device.answers = 1
    with served(device, port, pace), contextlib.closing(open_client(port)) as terminal:
        terminal.write(ALL_BYTES)
        assert terminal.read(256) == ALL_BYTES


def test_fast_pace_loses_no_bytes_to_a_slow_client(port, device):
    """Virtual time waits for it: 400 kB come while it reads a few bytes at a time."""
    sent = bytes(i * 37 % 251 for i in range(400_000))
    device.uart.on_byte = lambda _byte: device.uart.send(sent)
    with served(device, port, "fast"), contextlib.closing(open_client(port)) as client:
        client.write(b"?")
        assert client.read(len(sent)) == sent


def needs(program: str) -> pytest.MarkDecorator:
    missing = shutil.which(program) is None
    return pytest.mark.skipif(missing, reason=f"{program} is not installed")


def run(*command: str, stdin: bytes = b"") -> bytes:
    done = subprocess.run(command, input=stdin, capture_output=True, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs("socat")
def test_socat_gets_its_echo(kind, port, device, path):
    device.answers = 1
    address = f"{path},raw,echo=0" if kind == "pty" else "TCP:{}:{}".format(*port.address)
    with served(device, port, "fast"):
        assert run("socat", "-t0.3", "-", address, stdin=MESSAGE) == MESSAGE


@needs("picocom")
@a_pty
def test_picocom_gets_its_echo(port, device, path):
    device.answers = 1
    command = ["picocom", "-q", "-b", "115200", "--nolock", "--exit-after", "300", str(path)]
    with served(device, port, "fast"):
        assert MESSAGE in run(*command, stdin=MESSAGE)


@pytest.fixture
def c_client(tmp_path) -> Path:
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    program = tmp_path / "termios_client"
    source = Path(__file__).parent / "termios_client.c"
    run(*compiler.split(), "-Wall", "-Werror", "-o", str(program), str(source))
    return program


@a_pty
def test_c_termios_program_gets_its_echo(port, device, path, c_client):
    device.answers = 1
    with served(device, port, "fast"):
        for _ in range(3):
            assert run(str(c_client), str(path)) == b"echoed\n"


@a_pty
def test_plain_shell_script_gets_its_echo(port, device, path):
    device.answers = 1
    with served(device, port, "fast"):
        script = f"exec 3<>{path}; printf 'hello' >&3; head -c 5 <&3"
        assert run("sh", "-c", script) == b"hello"


SPARE_BYTES = 1_000_000
ADDRESS = 0x1A
HALF_A_FRAME = b"\x1f\x7f\x14"
SERIAL = ("pty", "tcp", "rfc2217")
ROLES = {"flood": 1, "unread": 2000, "stopped": 1, "polite": 1}
"""Who is at a line, and how many bytes the device answers to each byte on it."""


def serve(kernel: Kernel, ports, busy, waits: int, step: Callable[[int], None]) -> None:
    """A step in each wait; wall time passes in waits, as rounded by ``wait_ready``."""
    wall = Wall()

    def wait(watched, timeout_s: float) -> None:
        step(len(wall.waits) + 1)
        wall.wait(watched, max(0.001, timeout_s))
        if len(wall.waits) == waits:
            scheduler.stop()

    scheduler = RealtimeScheduler(kernel, ports, busy, Pace(kernel, "real", wall.clock), wait=wait)
    scheduler.run()


SLAVE = i2c_socket.pack_ioctl(linux_i2c.Ioctl.SLAVE, ADDRESS)
SET_ADDRESS = packed(i2c_socket.Call.IOCTL, SLAVE)
READING = i2c_socket.pack_rdwr([linux_i2c.RdwrMessage(ADDRESS, 1, 8)])
READ_BYTES = packed(i2c_socket.Call.RDWR, READING)


class Desk:
    """Every bad client and a polite one on each kind of port, and a bus for four of them."""

    def __init__(self, folder, stack: contextlib.ExitStack) -> None:
        self.kernel = Kernel()
        self.lines: dict[tuple[str, str], Device] = {}
        self.ports: dict[tuple[str, str], Any] = {}
        self.clients: dict[tuple[str, str], Client] = {}
        for kind in SERIAL:
            for role, answers in ROLES.items():
                line = self.lines[kind, role] = Device(self.kernel, 115_200, answers)
                port = self.ports[kind, role] = open_port(kind, folder / f"tty{role}", line.uart)
                stack.callback(port.close)
                self.clients[kind, role] = open_client(port)
        bus = I2cBus(self.kernel)
        bus.attach(ADDRESS, Memory())
        self.adapter = I2cAdapter(self.kernel, bus)
        self.server = I2cServer(folder / "i2c" / "bus", self.adapter)
        stack.callback(self.server.close)
        for role in ROLES:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            connection.connect(self.server.name)
            connection.sendall(GREETING)
            self.clients["i2c", role] = Client(connection)
        for client in self.clients.values():
            stack.callback(client.close)

    def busy(self) -> bool:
        return self.adapter.busy or any(line.uart.busy for line in self.lines.values())


def test_well_behaved_clients_are_served_beside_bad_ones(tmp_path):
    """On each kind of port one floods, one never reads, one stops in mid-frame.

    The fourth exchanges a byte a wait.
    """
    with contextlib.ExitStack() as stack:
        desk = Desk(tmp_path, stack)
        for kind in SERIAL:
            desk.clients[kind, "stopped"].write(HALF_A_FRAME)
        desk.clients["i2c", "stopped"].write(READ_BYTES[:-1])
        got = dict.fromkeys((*SERIAL, "i2c"), 0)

        def step(number: int) -> None:
            for kind, count in got.items():
                question = READ_BYTES if kind == "i2c" else b"?"
                desk.clients[kind, "flood"].write((SET_ADDRESS + question) * 2000)
                desk.clients[kind, "flood"].read_now()
                desk.clients[kind, "unread"].write(question * 100)
                got[kind] = count + len(desk.clients[kind, "polite"].read_now())
                desk.clients[kind, "polite"].write(question)
            if number == 60:
                tracemalloc.start()

        serve(desk.kernel, [*desk.ports.values(), desk.server], desk.busy, 130, step)
        grown, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert desk.kernel.now > PS_PER_S // 5
        full = 0.8 * desk.kernel.now / PS_PER_S * 11_520
        assert full > 1000
        for kind in SERIAL:
            assert len(desk.lines[kind, "polite"].received) >= 120
            assert got[kind] >= 110
            assert len(desk.lines[kind, "flood"].received) > full  # its wire is
            assert desk.lines[kind, "flood"].uart.host_backlog <= MAX_UNSENT
            assert desk.lines[kind, "stopped"].received == HALF_A_FRAME
            assert len(desk.ports[kind, "unread"]._unread) <= MAX_UNREAD
        assert got["i2c"] > 40 * (i2c_socket.LENGTH.size + 4 + 8)
        assert desk.server.clients == len(ROLES)
        assert (grown, peak) < (SPARE_BYTES, SPARE_BYTES)


def test_two_serial_lines_of_a_device_work_at_once(tmp_path):
    """As a CubeSense has them, with rates of their own."""
    kernel = Kernel()
    lines = [Device(kernel, 115_200, answers) for answers in (1, 3)]
    with contextlib.ExitStack() as stack:
        ports = [PtyEndpoint(tmp_path / f"tty{line.answers}", line.uart) for line in lines]
        clients = [open_client(port) for port in ports]
        for thing in (*ports, *clients):
            stack.callback(thing.close)

        def step(number: int) -> None:
            if number == 2:
                clients[0].write(b"abc")
                clients[1].write(b"q")

        serve(kernel, ports, lambda: any(line.uart.busy for line in lines), 20, step)
        assert (clients[0].read(3), clients[1].read(3)) == (b"abc", b"qqq")
