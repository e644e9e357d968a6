"""Several lines of one device at once, and clients that do what they should not.

``tests/system/test_bad_clients.py`` does the same to the command, in wall time.
"""

import contextlib
import socket
import tracemalloc
from collections.abc import Callable
from typing import Any

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.ports.rfc2217 import Rfc2217Endpoint
from cubestack.emulator.ports.serial_port import MAX_UNREAD, MAX_UNSENT
from cubestack.emulator.ports.tcp import TcpEndpoint
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.linux_i2c import (
    LENGTH,
    Call,
    Ioctl,
    RdwrMessage,
    pack_ioctl,
    pack_rdwr,
    request,
)

NS_PER_MS = 1_000_000
SPARE_BYTES = 1_000_000
ADDRESS = 0x1A
HALF_A_FRAME = b"\x1f\x7f\x14"
SERIAL = ("pty", "tcp", "rfc2217")
ROLES = {"flood": 1, "unread": 2000, "stopped": 1, "polite": 1}
"""Who is at a line, and how many bytes the device answers to each byte on it."""


class Line:
    """A line of a device that answers every byte with ``answers`` bytes."""

    def __init__(self, kernel: Kernel, answers: int) -> None:
        self.received = bytearray()
        self.heard = 0
        self._answers = answers
        self.uart = Uart(kernel, 115_200, self._on_byte, lambda: None, silence_bytes=1000)

    def _on_byte(self, byte: int) -> None:
        self.heard += 1
        self.received = self.received[-100:] + bytes([byte])
        if self.uart.backlog < 10_000:
            self.uart.send(bytes([byte]) * self._answers)


class Target:
    """Answers any read with zeros."""

    def i2c_start(self, read: bool) -> None: ...

    def i2c_write(self, byte: int) -> bool:
        return True

    def i2c_read(self) -> int:
        return 0

    def i2c_stop(self) -> None: ...


class Wall:
    """Wall time that passes when the scheduler waits, as rounded by ``wait_ready``.

    Something happens in each wait.
    """

    def __init__(self) -> None:
        self.ns = 0
        self.during_wait = lambda: None

    def clock(self) -> int:
        self.ns += 1000
        return self.ns

    def wait(self, _watched, timeout_s: float) -> None:
        self.during_wait()
        self.ns += max(NS_PER_MS, int(timeout_s * 1e9))


class Client:
    """A program at any port, which never blocks."""

    def __init__(self, write: Callable[[bytes], object], read: Callable[[], bytes]) -> None:
        self._write = write
        self._read = read

    def write(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            self._write(data)

    def read(self) -> bytes:
        try:
            return self._read()
        except BlockingIOError:
            return b""


def call(kind: Call, body: bytes) -> bytes:
    data = request(0, kind, body)
    return LENGTH.pack(len(data)) + data


SET_ADDRESS = call(Call.IOCTL, pack_ioctl(Ioctl.SLAVE, ADDRESS))
READ_BYTES = call(Call.RDWR, pack_rdwr([RdwrMessage(ADDRESS, 1, 8)]))


class Desk:
    """Every bad client and a polite one on each kind of port, and a bus for four of them."""

    def __init__(self, folder, terminal_at, connection_to, stack: contextlib.ExitStack) -> None:
        self.kernel = Kernel()
        self.lines: dict[tuple[str, str], Line] = {}
        self.ports: dict[tuple[str, str], Any] = {}
        self.clients: dict[tuple[str, str], Client] = {}
        for kind in SERIAL:
            for role, answers in ROLES.items():
                line = self.lines[kind, role] = Line(self.kernel, answers)
                path = folder / f"tty{role}"
                if kind == "pty":
                    port: Any = PtyEndpoint(path, line.uart)
                    opened = terminal_at(path)
                    client = Client(opened.write, opened.read_now)
                else:
                    make = TcpEndpoint if kind == "tcp" else Rfc2217Endpoint
                    port = make("127.0.0.1", 0, line.uart)
                    opened = connection_to(port.address)
                    client = self._of_socket(opened.socket)
                stack.callback(port.close)
                stack.callback(opened.close)
                self.ports[kind, role], self.clients[kind, role] = port, client
        bus = I2cBus(self.kernel)
        bus.attach(ADDRESS, Target())
        self.adapter = I2cAdapter(self.kernel, bus)
        self.server = I2cServer(folder / "i2c" / "bus", self.adapter)
        stack.callback(self.server.close)
        for role in ROLES:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            stack.callback(connection.close)
            connection.connect(self.server.name)
            self.clients["i2c", role] = self._of_socket(connection)

    @staticmethod
    def _of_socket(connection: socket.socket) -> Client:
        connection.setblocking(False)
        return Client(connection.send, lambda: connection.recv(1 << 16))

    def busy(self) -> bool:
        return self.adapter.busy or any(line.uart.busy for line in self.lines.values())


def test_polite_clients_are_served_beside_bad_ones(tmp_path, terminal_at, connection_to):
    """On each kind of port one floods, one never reads, one stops in mid-frame.

    The fourth exchanges a byte a wait.
    """
    wall = Wall()
    with contextlib.ExitStack() as stack:
        desk = Desk(tmp_path, terminal_at, connection_to, stack)
        for kind in SERIAL:
            desk.clients[kind, "stopped"].write(HALF_A_FRAME)
        desk.clients["i2c", "stopped"].write(READ_BYTES[:-1])
        got = dict.fromkeys((*SERIAL, "i2c"), 0)
        steps = 0
        scheduler = RealtimeScheduler(
            desk.kernel,
            [*desk.ports.values(), desk.server],
            desk.busy,
            pace="real",
            clock_ns=wall.clock,
            wait=wall.wait,
        )

        def step() -> None:
            nonlocal steps
            steps += 1
            for kind, count in got.items():
                question = READ_BYTES if kind == "i2c" else b"?"
                desk.clients[kind, "flood"].write((SET_ADDRESS + question) * 2000)
                desk.clients[kind, "flood"].read()
                desk.clients[kind, "unread"].write(question * 100)
                got[kind] = count + len(desk.clients[kind, "polite"].read())
                desk.clients[kind, "polite"].write(question)
            if steps == 200:
                tracemalloc.start()
            if steps == 600:
                scheduler.stop()

        wall.during_wait = step
        scheduler.run()
        grown, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert desk.kernel.now > PS_PER_S // 2
        full = 0.8 * desk.kernel.now / PS_PER_S * 11_520
        assert full > 1000
        for kind in SERIAL:
            assert desk.lines[kind, "polite"].heard >= 590
            assert got[kind] >= 580
            assert desk.lines[kind, "flood"].heard > full  # its wire is
            assert desk.lines[kind, "flood"].uart.host_backlog <= MAX_UNSENT
            assert bytes(desk.lines[kind, "stopped"].received) == HALF_A_FRAME
            assert len(desk.ports[kind, "unread"]._unread) <= MAX_UNREAD
        assert got["i2c"] > 200 * (LENGTH.size + 4 + 8)
        assert desk.server.clients == len(ROLES)
        assert (grown, peak) < (SPARE_BYTES, SPARE_BYTES)


def test_two_lines_of_a_device_at_once(tmp_path, terminal_at):
    """As a CubeSense has them, with rates of their own."""
    kernel, wall = Kernel(), Wall()
    node, bench = Line(kernel, 1), Line(kernel, 3)
    with contextlib.ExitStack() as stack:
        ports = [
            PtyEndpoint(tmp_path / name, line.uart)
            for name, line in (("tty", node), ("tty.bench", bench))
        ]
        clients = [terminal_at(tmp_path / name) for name in ("tty", "tty.bench")]
        for thing in (*ports, *clients):
            stack.callback(thing.close)
        scheduler = RealtimeScheduler(
            kernel,
            ports,
            lambda: node.uart.busy or bench.uart.busy,
            pace="real",
            clock_ns=wall.clock,
            wait=wall.wait,
        )
        waits = 0

        def step() -> None:
            nonlocal waits
            waits += 1
            if waits == 2:
                clients[0].write(b"abc")
                clients[1].write(b"q")
            if waits == 20:
                scheduler.stop()

        wall.during_wait = step
        scheduler.run()
        assert (clients[0].read(3), clients[1].read(3)) == (b"abc", b"qqq")
