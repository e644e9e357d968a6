"""The RFC 2217 port: raw telnet where every byte matters, pyserial where a host would be."""

import contextlib
import select
import socket
from pathlib import Path

import pytest
import serial
from serial import rfc2217 as telnet

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.ports import com_port
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
        option(telnet.PURGE_DATA, b"\1\2"),
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


RATE = DEVICE_BAUD.to_bytes(4, "big")
MODEM = bytes([0xB0])  # clear to send, data set ready, carrier

ANSWERS = [
    (com_port.SIGNATURE, b"", b"cubestack"),
    (com_port.SIGNATURE, b"a client", b"cubestack"),
    (com_port.SET_BAUDRATE, bytes(4), RATE),
    (com_port.SET_BAUDRATE, (9600).to_bytes(4, "big"), (9600).to_bytes(4, "big")),
    (com_port.SET_BAUDRATE, b"\xff" * 4, RATE),
    *((com_port.SET_DATASIZE, bytes([n]), bytes([m])) for n, m in ((0, 8), (5, 5), (9, 8))),
    *((com_port.SET_PARITY, bytes([n]), bytes([m])) for n, m in ((0, 1), (3, 3), (5, 5), (99, 1))),
    *((com_port.SET_STOPSIZE, bytes([n]), bytes([m])) for n, m in ((0, 1), (2, 2), (3, 3), (9, 1))),
    *(
        (com_port.SET_CONTROL, bytes([control.query]), bytes([control.values[0]]))
        for control in com_port.CONTROLS
    ),
    *(
        (com_port.SET_CONTROL, bytes([value]), bytes([value]))
        for control in com_port.CONTROLS
        for value in control.values
    ),
    (com_port.NOTIFY_LINESTATE, b"", b"\x60"),  # transmitter empty
    (com_port.NOTIFY_MODEMSTATE, b"", MODEM),
    (com_port.FLOWCONTROL_RESUME, b"", b""),
    (com_port.SET_LINESTATE_MASK, b"\x1e", b"\x1e"),
    (com_port.SET_MODEMSTATE_MASK, b"\0", b"\0"),
    *((com_port.PURGE_DATA, bytes([n]), bytes([n])) for n in (1, 2, 3)),
]


@pytest.mark.parametrize(("command", "value", "answer"), ANSWERS)
def test_each_command_is_acknowledged_with_the_value_in_effect(
    port, device, connect, command, value, answer
):
    client = connect()
    serve(port, device, client, option(bytes([command]), value.replace(b"\xff", b"\xff\xff")))
    expected = option(bytes([command + 100]), answer.replace(b"\xff", b"\xff\xff"))
    assert received_until(client, expected)


def test_all_commands_of_the_rfc_have_a_case():
    silencing = com_port.FLOWCONTROL_SUSPEND  # the test below
    assert {command for command, *_ in ANSWERS} == {*com_port.COMMANDS} - {silencing}
    assert {*range(13)} == {*com_port.COMMANDS}


def table() -> str:
    """The commands; the documentation has this table."""
    rows = [
        f"| {number} {command.name} | {command.meaning} |"
        for number, command in com_port.COMMANDS.items()
    ]
    return "\n".join(["| command | value of the acknowledgement |", "|-|-|", *rows])


def test_documented_table_is_that_of_the_commands():
    page = Path(__file__).parents[3] / "docs" / "how-to" / "serial-ports.md"
    shown = page.read_text(encoding="utf-8").split("emulator/ports/com_port.py -->\n")[1]
    assert shown.split("\n<!-- end of table -->")[0] == table()


def test_both_directions_of_flow_control_are_set_at_once_or_apart(port, device, connect):
    client = connect()
    for value, inbound in ((3, 16), (14, 14), (2, 15)):
        serve(port, device, client, option(telnet.SET_CONTROL, bytes([value])))
        serve(port, device, client, option(telnet.SET_CONTROL, b"\x0d"))
        assert received_until(client, option(telnet.SERVER_SET_CONTROL, bytes([inbound])))


def test_suspended_client_hears_nothing_until_it_resumes(port, device, connect):
    client = connect()
    received_until(client, telnet.WILL + telnet.COM_PORT_OPTION)
    serve(port, device, client, option(telnet.FLOWCONTROL_SUSPEND, b""))
    assert received_until(client, option(telnet.SERVER_FLOWCONTROL_SUSPEND, b""))
    device.sends(port, b"data")
    serve(port, device, client, baud_option(0))
    port.exchange(device.advance(100))
    assert not select.select([client.socket], [], [], 0)[0]
    serve(port, device, client, option(telnet.FLOWCONTROL_RESUME, b""))
    port.exchange(device.advance(100))
    rate = option(telnet.SERVER_SET_BAUDRATE, RATE)
    assert received_until(client, rate + option(telnet.SERVER_FLOWCONTROL_RESUME, b"") + b"data")


def test_modem_lines_drop_while_the_device_is_unplugged(port, device, connect):
    client = connect()
    serve(port, device, client, telnet.IAC + telnet.DO + telnet.COM_PORT_OPTION)
    serve(port, device, client, option(telnet.SET_MODEMSTATE_MASK, b"\xff\xff"))
    assert received_until(client, option(telnet.SERVER_NOTIFY_MODEMSTATE, MODEM))
    port.pull()
    assert received_until(client, option(telnet.SERVER_NOTIFY_MODEMSTATE, b"\x0b"))  # all changed
    port.plug(device.uart)
    assert received_until(client, option(telnet.SERVER_NOTIFY_MODEMSTATE, b"\xbb"))


def test_line_that_becomes_idle_is_notified(port, device, connect):
    client = connect()
    serve(port, device, client, option(telnet.SET_LINESTATE_MASK, b"\x60") + b"abc")
    assert received_until(client, option(telnet.SERVER_NOTIFY_LINESTATE, b"\x60"))


def test_break_of_the_line_is_notified(port, device, connect):
    client = connect()
    serve(port, device, client, option(telnet.SET_LINESTATE_MASK, b"\x10"))
    serve(port, device, client, baud_option(4 * DEVICE_BAUD))
    device.sends(port, b"\0")  # low for longer than a character of the client
    port.exchange(device.advance(20))
    assert received_until(client, option(telnet.SERVER_NOTIFY_LINESTATE, b"\x10"))


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


@pytest.mark.slow
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


# --- other clients -----------------------------------------------------------------------------


def test_serialx_opens_the_port_and_exchanges_bytes(port, device):
    serialx = pytest.importorskip("serialx")
    device.uart.on_byte = lambda byte: device.uart.send(bytes([byte + 1]))
    with (
        served(device, port, "fast"),
        serialx.serial_for_url(port.name, baudrate=DEVICE_BAUD, read_timeout=TIMEOUT_S) as client,
    ):
        client.write(b"abc")
        assert client.readexactly(3) == b"bcd"
        pins = client.get_modem_pins()
        assert pins.cts is pins.dsr is serialx.PinState.HIGH
