"""The RFC 2217 port: raw telnet where every byte matters, pyserial where a host would be."""

import contextlib
import select
import socket

import pytest
import serial
from serial import rfc2217 as telnet

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.ports.endpoint import PortError
from cubestack.emulator.ports.realtime import wait_ready
from cubestack.emulator.ports.rfc2217 import CHUNK_BYTES, Rfc2217Endpoint
from cubestack.emulator.ports.serial_port import MAX_UNREAD

from .conftest import TIMEOUT_S, ready, served

# pyserial calls setDaemon and setName of a thread.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")

DEVICE_BAUD = 1_000_000


def option(code: bytes, value: bytes) -> bytes:
    return telnet.IAC + telnet.SB + telnet.COM_PORT_OPTION + code + value + telnet.IAC + telnet.SE


def baud_option(baud: int) -> bytes:
    return option(telnet.SET_BAUDRATE, baud.to_bytes(4, "big"))


@pytest.fixture
def kind() -> str:
    return "rfc2217"


def received_until(client, end: bytes) -> bytes:
    data = b""
    while not data.endswith(end):
        data += client.read(1)
    return data


def serve(port, device, client, data: bytes, byte_times: int = 100) -> None:
    client.write(data)
    wait_ready(port.watched(), TIMEOUT_S)
    for _ in range(10):
        port.exchange(device.advance(byte_times // 10))


def test_rfc2217_listens_on_other_interfaces_only_if_allowed(device):
    with pytest.raises(PortError, match=r"0\.0\.0\.0 is open to other machines"):
        Rfc2217Endpoint("0.0.0.0", 0, device.uart)
    Rfc2217Endpoint("0.0.0.0", 0, device.uart, allow_remote=True).close()


def test_telnet_escapes_work_in_both_directions(port, device, connect):
    client = connect()
    serve(port, device, client, telnet.IAC + telnet.IAC + b"a", 100)
    assert device.received == b"\xffa"
    device.sends(port, b"\xffz")
    assert received_until(client, b"\xff\xffz")


def test_rfc2217_sends_device_bytes_in_the_same_exchange(port, device, connect):
    client = connect()
    device.uart.send(b"hello")
    port.exchange(device.advance(100))
    assert received_until(client, b"o").endswith(b"hello")


def test_new_client_has_the_devices_format(port, device, connect):
    first = connect()
    serve(port, device, first, baud_option(9600))
    assert device.uart.host_form == LineFormat(9600)
    first.reset()
    connect()
    assert device.uart.host_form == device.uart.form


@pytest.mark.parametrize(
    "junk",
    [
        telnet.IAC + telnet.SE,
        option(telnet.SET_BAUDRATE, b"\1"),
        option(telnet.SET_PARITY, b"\x63"),
        option(telnet.SET_LINESTATE_MASK, b""),
        telnet.IAC + telnet.SB + bytes(3000),
    ],
)
def test_client_that_breaks_the_protocol_is_dropped(port, device, connect, junk):
    client = connect()
    serve(port, device, client, junk)
    with contextlib.suppress(ConnectionResetError):
        while client.socket.recv(100):
            pass
    second = connect()
    serve(port, device, second, b"fine")
    assert device.received.endswith(b"fine")


@pytest.mark.parametrize("baud", [13_000_000, 0])
def test_rfc2217_impossible_rate_keeps_the_old_one(port, device, connect, baud):
    client = connect()
    serve(port, device, client, baud_option(baud))
    assert device.uart.host_form == device.uart.form
    answer = option(telnet.SERVER_SET_BAUDRATE, DEVICE_BAUD.to_bytes(4, "big"))
    assert received_until(client, answer)


def test_reports_line_errors_on_request(port, device, connect):
    client = connect()
    serve(port, device, client, option(telnet.SET_LINESTATE_MASK, b"\x0c"))
    serve(port, device, client, option(telnet.SET_PARITY, b"\3"))
    device.sends(port, b"\3")  # two ones, and the stop bit in the place of an even parity bit
    port.exchange(device.advance(5))
    assert received_until(client, option(telnet.SERVER_NOTIFY_LINESTATE, b"\4"))


def test_break_reaches_the_device(port, device, connect):
    serve(port, device, connect(), option(telnet.SET_CONTROL, telnet.SET_CONTROL_BREAK_ON))
    assert device.uart.framing_errors == 1


def test_rfc2217_purge_discards_bytes_not_yet_on_the_wire(port, device, connect):
    client = connect()
    client.write(bytes(50))
    wait_ready(port.watched(), TIMEOUT_S)
    port.exchange(device.kernel.now)
    client.write(option(telnet.PURGE_DATA, telnet.PURGE_TRANSMIT_BUFFER))
    wait_ready(port.watched(), TIMEOUT_S)
    port.exchange(device.advance(3))
    device.advance(100)
    assert 0 < len(device.received) < 50


def test_rfc2217_request_flood_without_reads_keeps_replies_bounded(port, device, connect):
    client = connect()
    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    request, sent, idle = option(telnet.NOTIFY_MODEMSTATE, b""), 0, 0
    while idle < 20:
        count = client.write(request * 1000)
        sent, idle = sent + count, 0 if count else idle + 1
        port.exchange(device.advance(1))
        assert len(port._replies) <= 3 * CHUNK_BYTES
    assert sent > 10 * CHUNK_BYTES
    assert ready(port) == []


def test_client_that_never_reads_keeps_memory_flat(port, device, connect):
    connect()
    for _ in range(100):
        device.sends(port, bytes([255]) * 100_000)
        assert len(port._unread) <= MAX_UNREAD
        assert len(port._replies) <= 3 * CHUNK_BYTES
    assert port.congested


# --- pyserial ----------------------------------------------------------------------------------


def open_url(port, **settings) -> serial.SerialBase:
    return serial.serial_for_url(port.name, DEVICE_BAUD, timeout=TIMEOUT_S, **settings)


def test_wrong_rate_garbles_reproducibly(port, device):
    heard = []
    device.uart.on_byte = lambda _byte: device.uart.send(b"UUUUUUUU")
    with served(device, port, "fast"):
        for _ in range(2):
            with open_url(port) as client:
                client.write(b"?")
                assert client.read(8) == b"UUUUUUUU"
                client.baudrate = 2 * DEVICE_BAUD  # each bit is seen twice
                device.uart.send(b"UUUUUUUU")
                heard.append(client.read(8))
    assert heard[0] == heard[1]
    assert heard[0][0] == 0b01100110  # 0 for the start's second half, then 1100110 of "U"


def test_bytes_with_wrong_parity_are_not_received(port, device):
    with served(device, port, "fast"), open_url(port, parity="E") as client:
        client.write(b"\3\3\3\1")
        client.parity = "N"
        client.write(b"!")
        device.wait_for(
            lambda: device.received.endswith(b"!"), doing=lambda: select.select([], [], [], 0.01)
        )
    assert device.received == b"\1!"
    assert device.uart.framing_errors == 3
