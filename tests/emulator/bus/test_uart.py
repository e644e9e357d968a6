"""The serial line: every byte at its time, both ways, and silence told once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from .ends import Desk

BAUD = 10_000
BYTE = 1_000_000_000  # 10 bits
SILENCE = 5


@pytest.fixture
def desk() -> Desk:
    return Desk(BAUD, SILENCE)


@pytest.mark.parametrize(("baud", "byte_ps"), [(9600, 1_041_666_666), (57600, 173_611_111)])
def test_byte_takes_ten_bits(baud, byte_ps):
    desk = Desk(baud)
    assert desk.uart.byte_ps == byte_ps
    desk.uart.host_writes(b"a")
    desk.uart.send(b"b")
    desk.kernel.run()
    assert desk.received == [(byte_ps, ord("a"))]
    assert desk.delivered == [(byte_ps, ord("b"))]


@given(st.lists(st.tuples(st.integers(0, 8 * BYTE), st.binary(max_size=5)), max_size=8))
def test_blocks_queue_up_behind_each_other_in_both_directions(writes):
    """Oracle: a byte starts when it was written or when the line is free, whichever is later."""
    desk = Desk(BAUD, SILENCE)
    expected, free = [], 0
    for gap, data in writes:
        desk.kernel.advance_to(desk.kernel.now + gap)
        desk.uart.host_writes(data)
        desk.uart.send(data)
        for byte in data:
            free = max(free, desk.kernel.now) + BYTE
            expected.append((free, byte))
    desk.kernel.run()
    assert desk.received == expected
    assert desk.delivered == expected


def test_device_sends_while_it_receives(desk):
    desk.uart.on_byte = lambda byte: desk.uart.send(bytes([byte, byte]))
    desk.uart.host_writes(b"xy")
    desk.kernel.run()
    times = [time // BYTE for time, _ in desk.delivered]
    assert times == [2, 3, 4, 5]
    assert bytes(byte for _, byte in desk.delivered) == b"xxyy"


def test_reports_every_pause_once(desk):
    for _ in range(3):
        desk.uart.host_writes(b"a")
        desk.kernel.advance_to(desk.kernel.now + 20 * BYTE)
    assert desk.silences == [(20 * i + 1 + SILENCE) * BYTE for i in range(3)]


def test_short_pause_is_not_a_silence(desk):
    for _ in range(10):
        desk.uart.host_writes(b"a")
        desk.kernel.advance_to(desk.kernel.now + (1 + SILENCE) * BYTE - 1)
    assert desk.silences == []
    assert len(desk.received) == 10


def test_byte_written_at_the_end_of_a_silence_is_received(desk):
    desk.uart.host_writes(b"a")
    desk.kernel.advance_to((1 + SILENCE) * BYTE)
    desk.uart.host_writes(b"b")
    desk.kernel.run()
    assert desk.data == b"ab"
    assert desk.silences[-1] == desk.received[-1][0] + SILENCE * BYTE


def test_backlog_counts_the_byte_on_the_line(desk):
    assert (desk.uart.backlog, desk.uart.busy) == (0, False)
    desk.uart.send(b"abc")
    counts = []
    for time in (0, BYTE - 1, BYTE, BYTE + 1, 3 * BYTE - 1, 3 * BYTE):
        desk.kernel.advance_to(time)
        counts.append((desk.uart.backlog, desk.uart.busy))
    assert counts == [(3, True), (3, True), (2, True), (2, True), (1, True), (0, False)]


def test_busy_while_the_host_sends(desk):
    desk.uart.host_writes(b"ab")
    desk.kernel.advance_to(2 * BYTE - 1)
    assert (desk.uart.host_backlog, desk.uart.busy) == (1, True)
    desk.kernel.advance_to(2 * BYTE + 1)
    assert (desk.uart.host_backlog, desk.uart.busy) == (0, False)


@pytest.mark.parametrize("said", [[], [b"only the device talks"]])
def test_nothing_heard_is_no_silence(desk, said):
    blocks = []
    desk.uart.line = lambda data, *_times: blocks.append(data)
    for data in (b"", *said):
        desk.uart.send(data)
    desk.uart.host_writes(b"")
    desk.kernel.advance_to(1000 * BYTE)
    assert (blocks, desk.silences) == (said, [])
