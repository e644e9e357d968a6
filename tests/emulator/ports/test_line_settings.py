"""Real pyserial clients at a pseudo-terminal that set another format than the device's."""

import os
import termios
from collections.abc import Iterator
from contextlib import closing

import pytest
import serial

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.tcp import REFUSAL
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent

from .conftest import ALL_BYTES, TIMEOUT_S, Device

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


def test_the_devices_own_format_and_none_at_all_are_good(desk):
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
def test_a_strict_line_has_the_clients_format(desk, form):
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
def test_the_next_client_is_understood(desk):
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


def test_a_rate_without_a_constant(tmp_path):
    desk = Desk(tmp_path / "tty", True, baud=123_456)
    with closing(desk.port):
        for rate, heard in ((123_456, True), (BAUD, False), (None, True)):
            with desk.client(baudrate=rate) if rate else open(desk.port.name, "r+b", 0) as client:
                client.write(b"\x00odd")
                assert (desk.serve() == b"\x00odd") is heard
            desk.serve()
        assert len(desk.told) == 1


def test_a_refused_client_is_sent_no_frame_of_any_protocol():
    decoder = FrameDecoder(64)
    assert FrameEvent.FRAME not in [decoder.feed(byte) for byte in 3 * REFUSAL]
    assert not {0x1F, 0x7F, 0xFF} & {*REFUSAL}  # escape and start of a frame, escape of telnet
