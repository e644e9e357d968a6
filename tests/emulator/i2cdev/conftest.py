"""Targets on a bus, and clients of its socket."""

import socket
import struct
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Literal

import pytest

from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.guest_process import Route, RouteError, Streams
from cubestack.emulator.i2cdev.pacing import wait_precisely
from cubestack.emulator.i2cdev.preload.shim import find_c_compiler
from cubestack.emulator.i2cdev.running import emulated_bus, run_program
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.emulator.ports.endpoint import poll_now
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.formats.i2c_socket import (
    LENGTH,
    VERSION,
    Call,
    pack_hello,
    packet,
    request,
    split_reply,
    unpack_targets,
)

TIMEOUT = struct.pack("ll", 20, 0)  # 20 s, for a socket


class Registers:
    """256 registers behind a pointer that counts up; beyond 0xF0 a write is not acknowledged."""

    def __init__(self) -> None:
        self.memory = bytearray(range(256))
        self.pointer = 0
        #: messages that came, as bytes written or number of bytes read
        self.log: list[list[int] | int] = []
        self.busy_reads = 0  #: how often the next byte is not ready yet
        self._first = True

    def i2c_start(self, read: bool) -> None:
        self._first = not read
        self.log.append(0 if read else [])

    def i2c_write(self, byte: int) -> bool:
        entry = self.log[-1]
        assert isinstance(entry, list)
        entry.append(byte)
        if self._first:
            self.pointer = byte
        elif self.pointer > 0xF0:
            return False
        else:
            self.memory[self.pointer] = byte
            self.pointer += 1
        self._first = False
        return True

    def i2c_read(self) -> int | None:
        if self.busy_reads:
            self.busy_reads -= 1
            return None
        entry = self.log[-1]
        assert isinstance(entry, int)
        self.log[-1] = entry + 1
        byte = self.memory[self.pointer & 0xFF]
        self.pointer += 1
        return byte

    def i2c_stop(self) -> None:
        self.log.append(-1)


@pytest.fixture
def registers() -> Registers:
    return Registers()


@pytest.fixture
def kernel() -> Kernel:
    return Kernel()


@pytest.fixture
def bus(kernel: Kernel, registers: Registers) -> I2cBus:
    bus = I2cBus(kernel, 400_000)
    bus.attach(0x1A, registers)
    return bus


@pytest.fixture
def adapter(kernel: Kernel, bus: I2cBus) -> I2cAdapter:
    return I2cAdapter(kernel, bus)


TARGETS = [("a sensor", 0x1A), ("another", 0x2B)]


def packed(call: Call, body: bytes, key: int = 0) -> bytes:
    return packet(request(key, call, body))


GREETING = packed(Call.HELLO, pack_hello())


def build_guest(source: Path, folder: Path) -> Path:
    """Compile a program in C; there must be a compiler."""
    compiler = find_c_compiler()
    assert compiler is not None
    built = folder / source.stem
    subprocess.run([*compiler, "-O1", source, "-o", built, "-lpthread"], check=True)
    return built


def run_guest(
    route: Route,
    command: Sequence[object],
    *,
    hz: int = 400_000,
    pace: Literal["real", "fast"] = "fast",
    timeout_s: float = 60.0,
    streams: Streams | None = None,
    report: Callable[[str], None] = lambda _text: None,
) -> tuple[int, str]:
    """Exit status and output of a program on a bus with one target; skips without the route.

    ``streams`` replace the file that receives the output.
    """
    kernel = Kernel()
    bus = I2cBus(kernel, hz)
    bus.attach(0x1A, Registers())
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as output:
        path = Path(folder, "private", "bus")
        opened = emulated_bus(kernel, lambda: False, I2cAdapter(kernel, bus), path)
        try:
            status = run_program(
                [str(word) for word in command],
                7,
                opened,
                pace=pace,
                route=route,
                streams=streams or (output.fileno(), None),
                timeout_s=timeout_s,
                report=report,
            )
        except RouteError as error:
            pytest.skip(str(error))
        finally:
            opened.port.close()
        output.seek(0)
        return status, output.read()


class Client:
    """A program with a connection to the server; it blocks with a timeout."""

    def __init__(self, path: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, TIMEOUT)
        self.socket.connect(path)

    def send(self, call: Call, body: bytes = b"", key: int = 0) -> None:
        self.socket.sendall(packed(call, body, key))

    def receive(self) -> tuple[int, bytes]:
        (length,) = LENGTH.unpack(self.socket.recv(LENGTH.size, socket.MSG_WAITALL))
        return split_reply(self.socket.recv(length, socket.MSG_WAITALL))

    def hung_up(self) -> bool:
        try:
            return self.socket.recv(1) == b""
        except ConnectionResetError:
            return True

    def reset(self) -> None:
        """Die without reading what is there."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


class Served:
    def __init__(self, path: Path, adapter: I2cAdapter) -> None:
        self.server = I2cServer(path, adapter, TARGETS)
        self.kernel = adapter.env
        self.adapter = adapter
        self.opened: list[Client] = []

    def connect(self, *, greeting: bool = True) -> Client:
        client = Client(self.server.name)
        self.opened.append(client)
        if greeting:
            client.socket.sendall(GREETING)
        self.serve()
        if greeting:
            result, data = client.receive()
            assert (result, unpack_targets(data)) == (VERSION, TARGETS)
        return client

    def serve(self) -> None:
        while True:
            ready = any(poll_now(*watched) for watched in self.server.watched())
            self.server.exchange(self.kernel.now)
            if not ready and not self.adapter.busy:
                return
            while self.adapter.busy:
                self.kernel.step()

    def wait(self, timeout_s: float) -> None:
        wait_precisely(self.server.watched(), timeout_s)

    def ask(self, client: Client, call: Call, body: bytes = b"", key: int = 0) -> tuple[int, bytes]:
        client.send(call, body, key)
        self.serve()
        return client.receive()


@pytest.fixture
def served(tmp_path: Path, adapter: I2cAdapter) -> Iterator[Served]:
    served = Served(tmp_path / "private" / "bus", adapter)
    yield served
    for client in served.opened:
        client.socket.close()
    served.server.close()


@pytest.fixture
def serve_at(adapter: I2cAdapter) -> Iterator[Callable[[Path], I2cServer]]:
    """Makes further servers."""
    made: list[I2cServer] = []

    def make(path: Path) -> I2cServer:
        made.append(I2cServer(path, adapter))
        return made[-1]

    yield make
    for server in made:
        server.close()
