"""The host's end of the line: every byte once, in order, never before its time."""

from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.sim.virtual_time import Kernel

BYTE = 10_000_000


def make() -> tuple[Kernel, Uart, HostLine]:
    kernel = Kernel()
    uart = Uart(kernel, 1_000_000, lambda _byte: None, lambda: None, silence_bytes=100)
    return kernel, uart, HostLine(uart)


@given(
    st.lists(st.binary(max_size=6), max_size=5),
    st.lists(st.tuples(st.integers(0, 3 * BYTE), st.none() | st.integers(0, 4)), max_size=30),
)
def test_receives_in_any_chunk_size(blocks, takes):
    """Oracle: byte i of an unbroken stream arrives after i + 1 byte times."""
    _, uart, line = make()
    for block in blocks:
        uart.send(block)
    sent, taken, now = b"".join(blocks), b"", 0
    for step, limit in takes:
        now += step
        arrived = min(len(sent), now // BYTE)
        for count in range(1, len(sent) + 2):
            expected_ps = min(len(taken) + count, len(sent)) * BYTE
            assert line.arrival_ps(count) == (None if taken == sent else expected_ps)
        got = line.take(now, limit)
        expected = arrived - len(taken) if limit is None else min(arrived - len(taken), limit)
        assert len(got) == expected
        taken += got
    assert taken + line.take(10**12) == sent


def test_unplugged_line_hears_nothing():
    kernel, uart, line = make()
    uart.send(b"before")
    line.unplug()
    uart.send(b"after")
    assert line.take(10**12) == b""
    kernel.run()


def test_newer_line_takes_over():
    _, uart, older = make()
    newer = HostLine(uart)
    uart.send(b"x")
    older.unplug()  # which is not plugged in any more
    uart.send(b"y")
    assert older.take(10**12) == b""
    assert newer.take(10**12) == b"xy"
