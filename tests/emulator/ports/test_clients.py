"""Clients of any port that leave, flood or never read; the test makes the scheduler look."""

import contextlib

import pytest

from cubestack.emulator.ports.realtime import wait_ready
from cubestack.emulator.ports.serial_port import MAX_UNSENT
from cubestack.emulator.ports.tcp import MAX_AHEAD_AT_ONCE, TCP_RECEIVE_BUFFER

from .checks import a_tcp, assert_fresh, hears, unsent
from .conftest import TIMEOUT_S, open_client, ready


@pytest.mark.parametrize("leave", ["close", "reset"])
@pytest.mark.parametrize("unread", [1, 100, 60_000, 500_000])
def test_client_receives_no_data_of_its_predecessor(port, device, connect, unread, leave):
    first = connect()
    for _ in range(0, unread, 10_000):
        device.sends(port, b"stale" * min(unread, 2000))
    getattr(first, leave)()
    port.exchange(device.kernel.now)
    assert_fresh(port, device, connect())


def test_drops_output_without_a_client(port, device, connect):
    device.sends(port, b"stale")
    assert_fresh(port, device, connect())


def test_input_of_a_client_that_closes_at_once_arrives(port, device):
    with contextlib.closing(open_client(port)) as client:
        client.write(b"last words")
    assert device.hears(port, 10) == b"last words"


@pytest.mark.parametrize("leave", ["close", "reset"])
def test_bytes_of_a_client_that_dies_within_a_frame_are_kept(port, device, connect, leave):
    first = connect()
    first.write(b"half a fra")
    assert device.hears(port, 10) == b"half a fra"
    getattr(first, leave)()
    for _ in range(3):
        device.sends(port, b"to nobody")
    second = connect()
    second.write(b"whole")
    assert device.hears(port, 15) == b"half a frawhole"
    assert_fresh(port, device, second)


@a_tcp
def test_flood_of_a_client_that_has_left_does_not_keep_the_next_one_out(port, device, connect):
    """The end of its connection lies behind megabytes that the line had no time for."""
    first = connect()
    first.socket.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            first.socket.send(bytes(1 << 16))
    first.close()
    port.exchange(device.kernel.now)
    second = connect()
    device.wait_for(lambda: hears(second), doing=lambda: device.sends(port, b"."))
    assert second.read(1) == b"."


@a_tcp
def test_flood_is_read_in_bounded_parts(port, device, connect):
    """So that the device has its turn in between, whoever wants to be the next client."""
    first = connect()
    first.socket.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            first.socket.send(bytes(1 << 16))
    port.exchange(device.kernel.now)
    connect()
    for _ in range(3):
        before = unsent(first)
        port.exchange(device.kernel.now)
        assert unsent(first) >= before - MAX_AHEAD_AT_ONCE - 4 * TCP_RECEIVE_BUFFER
        assert ready(port)


@a_tcp
def test_client_that_floods_and_stays_keeps_its_bytes(port, device, connect):
    """Although what it sent is read when another one comes, to find out whether it has left."""
    first = connect()
    first.socket.setblocking(False)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while sent < 100_000:
            sent += first.socket.send(bytes(range(250)) * 40)
    port.exchange(device.kernel.now)
    with contextlib.closing(open_client(port)) as second:
        device.wait_for(lambda: hears(second), doing=lambda: port.exchange(device.kernel.now))
        assert second.read(10) == b"cubestack:"
    while len(device.received) < sent:
        before = len(device.received)
        port.exchange(device.advance(MAX_UNSENT))
        assert len(device.received) > before
    assert device.received == (bytes(range(250)) * (sent // 250 + 1))[:sent]


def test_fast_client_is_limited_to_the_line_rate(port, device, connect):
    client = connect()
    sent = bytes(i * 37 % 251 for i in range(40_000))
    position, backlogs = 0, set()

    def serve() -> None:
        nonlocal position
        position += client.write(sent[position:])
        port.exchange(device.advance(500))
        backlogs.add(device.uart.host_backlog)

    device.wait_for(lambda: len(device.received) == len(sent), doing=serve)
    assert device.received == sent
    assert max(backlogs) == MAX_UNSENT


def test_flooding_client_causes_no_wakeups_and_frees_the_port_when_it_dies(
    kind, port, device, connect
):
    first, sent = connect(), 0
    while count := first.write(bytes(1 << 20)):
        sent += count
    device.wait_for(
        lambda: device.uart.host_backlog == MAX_UNSENT,
        doing=lambda: (first.write(bytes(1 << 20)), port.exchange(device.kernel.now)),
    )
    first.write(b"more")
    port.exchange(device.kernel.now)
    assert ready(port) == []
    first.reset()
    assert kind == "pty" or ready(port) == []
    port.exchange(device.kernel.now)
    assert_fresh(port, device, connect())


def test_idle_port_causes_no_wakeups(port, device, connect):
    port.exchange(device.kernel.now)
    assert ready(port) == []
    client = connect()
    port.exchange(device.kernel.now)
    assert ready(port) == []
    client.close()
    wait_ready(port.watched(), TIMEOUT_S)
    assert ready(port) != []  # the end is noticed at once
    port.exchange(device.kernel.now)
    assert ready(port) == []


def test_client_that_never_reads_causes_no_wakeups(port, device, connect):
    connect()
    device.wait_for(lambda: port.congested, doing=lambda: device.sends(port, bytes(1 << 17)))
    device.wait_for(lambda: not ready(port), doing=lambda: port.exchange(device.kernel.now))
    assert port.congested
