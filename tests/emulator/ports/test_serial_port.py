import select
from dataclasses import dataclass, field

import pytest

from cubestack.emulator.ports.serial_port import MAX_UNREAD, MAX_UNSENT, SerialPort


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


def test_a_client_is_waited_for_while_there_is_room_for_what_it_writes(port, device):
    connect(port, device, Client())
    assert port._events(reading=True) == select.POLLIN
    assert port._events(reading=False) == 0
    device.uart.host_writes(bytes(MAX_UNSENT))
    assert port._events(reading=True) == 0


def test_releases_are_announced(port, device):
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


def test_client_does_not_receive_earlier_bytes(port, device):
    device.uart.send(b"stale")
    device.advance(5)
    client = connect(port, device, Client())
    device.uart.send(b"fresh")
    port.exchange(device.advance(5))
    assert client.read == b"fresh"


def test_client_receives_bytes_still_on_the_wire(port, device):
    device.uart.send(b"answer")
    device.advance(2)
    client = connect(port, device, Client())
    port.exchange(device.advance(4))
    assert client.read == b"swer"


def test_closed_port_hears_nothing(port, device):
    client = connect(port, device, Client())
    port.close()
    device.uart.send(b"x")
    port.exchange(device.advance(1))
    assert not client.read
