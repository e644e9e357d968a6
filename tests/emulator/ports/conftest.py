"""Clients of the ports, and a UART in front of a program that answers, or only listens.

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
from cubestack.emulator.ports.endpoint import Endpoint, poll_now
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import RealtimeScheduler, wait_ready
from cubestack.emulator.ports.rfc2217 import Rfc2217Endpoint
from cubestack.emulator.ports.tcp import TcpEndpoint
from cubestack.emulator.sim.virtual_time import Kernel

ALL_BYTES = bytes(range(256))
LOOPBACK = "127.0.0.1"
TIMEOUT_S = 20.0  # of a client that waits for what must come
NS_PER_MS = 1_000_000
ORIGIN_NS = 123_456_789_012_345  # wall time at the start of a test


class Wall:
    """Wall time of the test. Attributes: the waits so far in s, and the ns of odd ones."""

    def __init__(self) -> None:
        self.ns = ORIGIN_NS
        self.waits: list[float] = []
        self.during_wait: dict[int, int] = {}

    def clock(self) -> int:
        self.ns += 10_000
        return self.ns

    def wait(self, _watched: Any, timeout_s: float) -> None:
        self.ns += self.during_wait.get(len(self.waits), int(timeout_s * 1e9))
        self.waits.append(timeout_s)

    @property
    def ms(self) -> float:
        return (self.ns - ORIGIN_NS) / NS_PER_MS


class Device:
    """A UART, by default at 1 Mbaud: a byte takes 10 us."""

    def __init__(self, kernel: Kernel, baud: int = 1_000_000, answers: int = 0) -> None:
        self.kernel = kernel
        self.received = bytearray()  #: all bytes that came
        self.answers = answers  #: how often every byte is sent back
        self.uart = Uart(kernel, baud, self._on_byte, lambda: None, silence_bytes=1_000_000)

    def _on_byte(self, byte: int) -> None:
        self.received.append(byte)
        if self.uart.backlog < 10_000:
            self.uart.send(bytes([byte]) * self.answers)

    def advance(self, byte_times: int) -> int:
        """Advance by byte times, the events of the last instant included; returns the time."""
        self.kernel.advance_to(self.kernel.now + byte_times * self.uart.byte_ps)
        while self.kernel.horizon() == self.kernel.now:
            self.kernel.step()
        return self.kernel.now

    def sends(self, port: Endpoint, data: bytes) -> None:
        self.uart.send(data)
        port.exchange(self.advance(len(data)))

    def hears(self, port: Endpoint, count: int) -> bytes:
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


class Client:
    """A program at a terminal or a socket, which blocks in ``read`` alone."""

    def __init__(self, end: int | socket.socket) -> None:
        self.socket = None if isinstance(end, int) else end
        self.fd = end if isinstance(end, int) else end.fileno()
        os.set_blocking(self.fd, False)

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            assert select.select([self.fd], [], [], TIMEOUT_S)[0], f"only {len(data)} bytes came"
            part = os.read(self.fd, count - len(data))
            assert part, f"closed after {len(data)} bytes"
            data += part
        return data

    def read_now(self) -> bytes:
        try:
            return os.read(self.fd, 1 << 16)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        if self.socket is None:
            os.close(self.fd)
        else:
            self.socket.close()

    def reset(self) -> None:
        """Die: a connection is torn down without a word."""
        if self.socket is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close()


def open_port(kind: str, path: Path, uart: Uart) -> Any:
    if kind == "pty":
        return PtyEndpoint(path, uart)
    return {"tcp": TcpEndpoint, "rfc2217": Rfc2217Endpoint}[kind](LOOPBACK, 0, uart)


def open_client(port: Any) -> Client:
    if isinstance(port, PtyEndpoint):
        return Client(os.open(port.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK))
    return Client(socket.create_connection(port.address, TIMEOUT_S))


def ready(port: Endpoint) -> list[int]:
    return [fd for fd, events in port.watched() if poll_now(fd, events)]


@contextlib.contextmanager
def served(device: Any, endpoint: Endpoint, pace: Any) -> Iterator[None]:
    scheduler = RealtimeScheduler(
        device.kernel, [endpoint], lambda: device.uart.busy, Pace(device.kernel, pace)
    )
    thread = threading.Thread(target=scheduler.run)
    thread.start()
    try:
        yield
    finally:
        scheduler.stop()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


@pytest.fixture
def device() -> Device:
    return Device(Kernel())


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "ttyTEST"


@pytest.fixture(params=["pty", "tcp"])
def kind(request) -> str:
    return request.param


@pytest.fixture
def port(kind, device, path) -> Iterator[Any]:
    endpoint = open_port(kind, path, device.uart)
    yield endpoint
    endpoint.close()


@pytest.fixture
def connect(port, device) -> Iterator[Callable[[], Client]]:
    """Opens a client and lets the port notice."""
    opened: list[Client] = []

    def connect_one() -> Client:
        opened.append(open_client(port))
        if not isinstance(port, PtyEndpoint):
            wait_ready(port.watched(), TIMEOUT_S)
        port.exchange(device.kernel.now)
        return opened[-1]

    yield connect_one
    for client in opened:
        with contextlib.suppress(OSError):
            client.close()
