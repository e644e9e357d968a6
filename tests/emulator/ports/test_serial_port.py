"""Clients of a port: every byte once, in order, in time; clients of another format."""

import os
import select
import termios
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field

import pytest
import serial

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.serial_port import MAX_UNREAD, MAX_UNSENT, SerialPort
from cubestack.emulator.ports.tcp import REFUSAL
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent

from .conftest import ALL_BYTES, TIMEOUT_S, Device


@dataclass(eq=False)
class Client:
    """Attributes: how much more it will read, and what it has read."""

    appetite: int = 10**9
    read: bytearray = field(default_factory=bytearray)


class Port(SerialPort):
    client: Client | None = None

    def _find_client(self) -> Client | None:
        return self.client

    def _read(self, max_bytes: int) -> bytes:
        return b""

    def _write(self, data: bytearray) -> int:
        assert self.client is not None
        count = min(len(data), self.client.appetite)
        self.client.read += data[:count]
        self.client.appetite -= count
        return count


@pytest.fixture
def port(device) -> Port:
    return Port(device.uart)


def connect(port: Port, device, client: Client) -> Client:
    port.client = client
    port.exchange(device.kernel.now)
    return client


def test_bytes_are_released_when_they_have_arrived(port, device):
    client = connect(port, device, Client())
    device.uart.send(b"abc")
    for arrived in (b"", b"a", b"ab", b"abc", b"abc"):
        port.exchange(device.kernel.now)
        assert client.read == arrived
        device.advance(1)


def test_serial_port_stops_reading_when_its_buffer_is_full(port, device):
    connect(port, device, Client())
    assert port._events(reading=True) == select.POLLIN
    assert port._events(reading=False) == 0
    device.uart.host_writes(bytes(MAX_UNSENT))
    assert port._events(reading=True) == 0


def test_serial_port_announces_byte_release_times(port, device):
    byte_ps = device.uart.byte_ps
    connect(port, device, Client())
    device.uart.send(b"abc")
    assert [port.release_ps(count) for count in (1, 2, 9)] == [byte_ps, 2 * byte_ps, 3 * byte_ps]
    port.exchange(device.advance(2))
    assert [port.release_ps(count) for count in (1, 2)] == [3 * byte_ps, 3 * byte_ps]
    port.exchange(device.advance(1))
    assert port.release_ps(1) is None


def test_slow_client_keeps_the_newest_bytes(port, device):
    client = connect(port, device, Client(appetite=10))
    sent = bytes(i * 37 % 251 for i in range(3 * MAX_UNREAD))
    device.uart.send(sent[:100])
    port.exchange(device.advance(100))
    assert port.congested
    device.uart.send(sent[100:])
    port.exchange(device.advance(len(sent)))
    client.appetite = 10**9
    port.exchange(device.kernel.now)
    assert client.read == sent[:10] + sent[-MAX_UNREAD:]
    assert not port.congested


def test_next_client_receives_no_stale_output(port, device):
    connect(port, device, Client(appetite=0))
    device.uart.send(b"stale")
    port.exchange(device.advance(5))
    assert port.congested
    client = connect(port, device, Client())
    assert not port.congested
    device.uart.send(b"fresh")
    port.exchange(device.advance(5))
    assert client.read == b"fresh"


@pytest.mark.parametrize("arrived", [0, 2, 6])
def test_client_receives_bytes_still_on_the_wire(port, device, arrived):
    device.uart.send(b"answer")
    device.advance(arrived)
    client = connect(port, device, Client())
    device.uart.send(b"!")
    port.exchange(device.advance(7))
    assert client.read == b"answer!"[arrived:]


def test_closed_port_sends_nothing_to_its_client(port, device):
    client = connect(port, device, Client())
    port.close()
    device.uart.send(b"x")
    port.exchange(device.advance(1))
    assert not client.read


BAUD = 57_600

WRONG = {
    "9600 8N1": {"baudrate": 9600},
    "57599 8N1": {"baudrate": 57_599},
    "115200 8N2": {"baudrate": 115_200, "stopbits": 2},
    "57600 8O1": {"parity": "O"},
    "57600 8M1": {"parity": "M"},
    "57600 8S1": {"parity": "S"},
}


class Desk:
    """A device whose port is a pseudo-terminal; clients come one after the other."""

    def __init__(self, path, strict: bool, baud: int = BAUD) -> None:
        self.device = Device(Kernel(), baud)
        self.strict, self.told = strict, list[str]()
        self.port = PtyEndpoint(path, self.device.uart, strict=strict, report=self.told.append)

    def client(self, **settings) -> serial.Serial:
        opened = serial.Serial(
            self.port.name, **({"baudrate": BAUD, "timeout": TIMEOUT_S} | settings)
        )
        self.serve(0)
        return opened

    def serve(self, byte_times: int = 3000) -> bytes:
        """Bytes that the device received, once both sides have everything that was written."""
        self.device.received.clear()
        for _ in range(50):
            self.port.exchange(self.device.advance(byte_times // 50))
        return bytes(self.device.received)


@pytest.fixture(params=[False, True], ids=["lenient", "strict"])
def desk(request, tmp_path) -> Iterator[Desk]:
    found = Desk(tmp_path / "tty", request.param)
    with closing(found.port):
        yield found


strict = pytest.mark.parametrize("desk", [True], indirect=True)


@pytest.mark.parametrize("form", WRONG)
def test_reports_wrong_format_once_per_client(desk, form):
    for count in (1, 2):
        with desk.client(**WRONG[form]) as client:
            assert len(desk.told) == count - 1  # nothing was said so far
            for data in (ALL_BYTES, b"second"):
                client.write(data)
                assert desk.serve() == data or desk.strict
        desk.serve()
        assert len(desk.told) == count
    assert f"a client has set {form}, the device has 57600 8N1: " in desk.told[0]
    assert desk.told[0].startswith(f"{desk.port.name}: ")


def test_line_accepts_the_devices_own_and_unset_terminal_formats(desk):
    with desk.client() as client:
        client.write(b"mine")
        assert desk.serve() == b"mine"
    desk.serve()
    end = os.open(desk.port.name, os.O_RDWR | os.O_NOCTTY)
    assert termios.tcgetattr(end)[4:6] == [termios.B57600] * 2
    os.write(end, b"untouched")
    assert desk.serve() == b"untouched"
    os.close(end)
    assert desk.told == []


@pytest.mark.parametrize("settings", [{"parity": "E"}, {"bytesize": 7}])
def test_settings_hidden_by_the_kernel_are_not_reported(desk, settings):
    with desk.client(**settings) as client:
        client.write(b"hidden")
        assert desk.serve() == b"hidden"
    assert desk.told == []


@strict
@pytest.mark.parametrize("form", WRONG)
def test_strict_pty_garbles_bytes_like_a_line_of_the_same_format(desk, form):
    """Beside a line without any terminal."""
    baud, rest = form.split()
    other = Device(Kernel(), BAUD)
    line = HostLine(other.uart)
    line.form = LineFormat(int(baud), 8, rest[1], int(rest[2]))
    with desk.client(**WRONG[form]) as client:
        client.write(ALL_BYTES)
        line.uart.host_writes(ALL_BYTES)
        other.advance(3000)
        assert desk.serve() == bytes(other.received)
        desk.device.uart.send(ALL_BYTES)
        other.uart.send(ALL_BYTES)
        desk.serve()
        wanted = line.take(other.advance(3000))
        assert client.read(len(wanted)) == wanted
        assert client.in_waiting == 0
        right = (wanted, bytes(other.received)) == (ALL_BYTES, ALL_BYTES)
        assert right is (form == "57599 8N1")


@strict
def test_pty_understands_the_next_client_after_a_wrong_rate(desk):
    with desk.client(baudrate=9600) as client:
        client.write(b"garbled")
        assert desk.serve() != b"garbled"
        client.baudrate = BAUD
        client.write(b"better")
        assert desk.serve() == b"better"
        client.baudrate = 9600
    desk.serve()
    with open(desk.port.name, "r+b", buffering=0) as client:
        client.write(b"fresh")
        assert desk.serve() == b"fresh"


def test_non_standard_baud_rate_is_checked_like_a_standard_one(tmp_path):
    desk = Desk(tmp_path / "tty", True, baud=123_456)
    with closing(desk.port):
        for rate, heard in ((123_456, True), (BAUD, False), (None, True)):
            with desk.client(baudrate=rate) if rate else open(desk.port.name, "r+b", 0) as client:
                client.write(b"\x00odd")
                assert (desk.serve() == b"\x00odd") is heard
            desk.serve()
        assert len(desk.told) == 1


def test_refused_client_receives_no_frame_of_any_protocol():
    decoder = FrameDecoder(64)
    assert FrameEvent.FRAME not in [decoder.feed(byte) for byte in 3 * REFUSAL]
    assert not {0x1F, 0x7F, 0xFF} & {*REFUSAL}  # escape and start of a frame, escape of telnet
