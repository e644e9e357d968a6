"""Clients of the ports, and a UART in front of a program that echoes, or only listens.

Clients block with a timeout; nothing sleeps.
"""

import contextlib
import os
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import RealtimeScheduler, wait_ready
from cubestack.emulator.ports.tcp import TcpEndpoint
from cubestack.emulator.sim.virtual_time import Kernel

TIMEOUT_S = 20.0  # of a client that waits for what must come


class Device:
    """A UART at 1 Mbaud: a byte takes 10 us.

    Attributes:
        echoes: whether every byte is sent back.
        received: all bytes that came.
    """

    def __init__(self) -> None:
        self.kernel = Kernel()
        self.received = bytearray()
        self.echoes = False
        self.uart = Uart(
            self.kernel, 1_000_000, self._on_byte, lambda: None, silence_bytes=1_000_000
        )

    def _on_byte(self, byte: int) -> None:
        self.received.append(byte)
        if self.echoes:
            self.uart.send(bytes([byte]))

    def advance(self, byte_times: int) -> int:
        """Let so many byte times pass, with all that happens at the last instant; the time then."""
        self.kernel.advance_to(self.kernel.now + byte_times * self.uart.byte_ps)
        while self.kernel.horizon() == self.kernel.now:
            self.kernel.step()
        return self.kernel.now

    def sends(self, port: Endpoint, data: bytes) -> None:
        """Send ``data`` and let ``port`` hand it over."""
        self.uart.send(data)
        port.exchange(self.advance(len(data)))

    def hears(self, port: Endpoint, count: int) -> bytes:
        """Serve until so many bytes have come."""
        self.wait_for(
            lambda: len(self.received) >= count,
            doing=lambda: (wait_ready(port.watched(), 0.01), port.exchange(self.advance(100))),
        )
        return bytes(self.received)

    def wait_for(self, condition: Callable[[], object], *, doing: Callable[[], object]) -> None:
        """Do something that blocks for a moment at most, until the condition holds."""
        deadline = time.monotonic() + TIMEOUT_S
        while not condition():
            assert time.monotonic() < deadline
            doing()


class Terminal:
    """A program with the slave open, without blocking."""

    def __init__(self, path: Path) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            assert select.select([self.fd], [], [], TIMEOUT_S)[0], f"only {len(data)} bytes came"
            data += os.read(self.fd, count - len(data))
        return data

    def read_now(self) -> bytes:
        """What is there; BlockingIOError when there is nothing."""
        return os.read(self.fd, 1 << 16)

    def write(self, data: bytes) -> int:
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        os.close(self.fd)


class Connection:
    """A client of a TCP port, which blocks."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = socket.create_connection(address, TIMEOUT_S)

    def receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            assert part, f"closed after {len(data)} bytes"
            data += part
        return data

    def close(self) -> None:
        self.socket.close()

    def reset(self) -> None:
        """Die: the connection is torn down without a word."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "ttyTEST"


@pytest.fixture
def pty(device, path) -> Iterator[PtyEndpoint]:
    endpoint = PtyEndpoint(path, device.uart)
    yield endpoint
    endpoint.close()


@pytest.fixture
def open_terminal(pty, device, path) -> Iterator[Callable[[], Terminal]]:
    """Opens the slave and lets the port notice."""
    opened: list[Terminal] = []

    def open_one() -> Terminal:
        opened.append(Terminal(path))
        pty.exchange(device.kernel.now)
        return opened[-1]

    yield open_one
    for terminal in opened:
        with contextlib.suppress(OSError):
            terminal.close()


@pytest.fixture
def tcp(device) -> Iterator[TcpEndpoint]:
    endpoint = TcpEndpoint("127.0.0.1", 0, device.uart)
    yield endpoint
    endpoint.close()


@pytest.fixture
def connect(tcp, device) -> Iterator[Callable[[], Connection]]:
    """Connects and lets the port notice."""
    opened: list[Connection] = []

    def connect_one() -> Connection:
        opened.append(Connection(tcp.address))
        wait_ready(tcp.watched(), TIMEOUT_S)
        tcp.exchange(device.kernel.now)
        return opened[-1]

    yield connect_one
    for client in opened:
        client.close()


@pytest.fixture
def terminal_at() -> type[Terminal]:
    """Opens the slave; whoever serves the port may notice."""
    return Terminal


@pytest.fixture
def connection_to() -> type[Connection]:
    """Connects; whoever serves the port may notice."""
    return Connection


@contextlib.contextmanager
def _served(device: Any, endpoint: Endpoint, pace: Any) -> Iterator[None]:
    scheduler = RealtimeScheduler(device.kernel, [endpoint], lambda: device.uart.busy, pace=pace)
    thread = threading.Thread(target=scheduler.run)
    thread.start()
    try:
        yield
    finally:
        scheduler.stop()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


@pytest.fixture
def served() -> Callable[..., contextlib.AbstractContextManager[None]]:
    """served(device, endpoint, pace): the endpoint is served by a scheduler in a thread."""
    return _served
