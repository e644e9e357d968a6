"""Traces against an independent reader of VCD files, and a receiver on the drawn levels."""

import io
import re

from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.bus.uart import LineFormat, Uart
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.emulator.sim.virtual_time import Kernel

from ..bus.ends import Memory
from .vcd import read

BAUD = 57_600


def received(levels: list[tuple[int, object]]) -> bytes:
    def level(time_ns: float) -> int:
        return int([value for then, value in levels if then <= time_ns][-1])

    bit_ns, data, free_ns = 1e9 / BAUD, bytearray(), 0.0
    for time_ns, value in levels:
        if int(value) == 0 and time_ns >= free_ns:
            data.append(sum(level(time_ns + (k + 1.5) * bit_ns) << k for k in range(8)))
            free_ns = time_ns + 9.5 * bit_ns
    return bytes(data)


@given(st.lists(st.tuples(st.integers(0, 10**9), st.binary(max_size=5)), max_size=4))
def test_drawn_levels_are_the_bytes(writes):
    kernel, stream = Kernel(), io.StringIO()
    uart = Uart(
        kernel, BAUD, lambda byte: uart.send(bytes([byte ^ 0xFF])), lambda: None, silence_bytes=10
    )
    trace = VcdTrace(stream, "echo", kernel, {"uart": uart})
    for pause_ps, data in writes:
        kernel.advance_to(kernel.now + pause_ps)
        uart.host_writes(data)
    kernel.run()
    trace.close()
    sent = b"".join(data for _, data in writes)
    changes = read(io.BytesIO(stream.getvalue().encode()))
    assert received(changes["uart.rx"]) == sent
    assert received(changes["uart.tx"]) == bytes(byte ^ 0xFF for byte in sent)


def test_characters_of_another_form_are_counted_in_a_word():
    kernel, stream = Kernel(), io.StringIO()
    uart = Uart(kernel, BAUD, lambda _byte: None, lambda: None, silence_bytes=10)
    trace = VcdTrace(stream, "board", kernel, {"uart": uart})
    uart.host_form = LineFormat(BAUD, parity="S")
    uart.host_writes(b"bc")
    kernel.run()
    trace.close()
    text = stream.getvalue()
    changes = read(io.BytesIO(text.encode()))
    assert [int(value) for _, value in changes["uart.framing_errors"]] == [0, 1, 2]
    bits = {name: int(size) for size, name in re.findall(r"\$var wire (\d+) \S+ (\w+)", text)}
    assert bits == {"rx": 1, "tx": 1, "rx_byte": 8, "tx_byte": 8, "framing_errors": 32}


def test_probes_and_transfers():
    kernel, stream, state = Kernel(), io.StringIO(), {"task": "IDLE", "n": 0}
    bus = I2cBus(kernel)
    bus.attach(0x1A, Memory(first=0x42))
    trace = VcdTrace(stream, "board", kernel, {}, None, lambda: state)
    trace.listen(bus)

    def run():
        yield kernel.timeout(1_000_000)
        state["task"] = "BUSY"
        state["n"] = 5
        yield from bus.transfer([I2cMessage(0x1A, bytearray(b"\1")), I2cMessage(0x1A, read=1)])

    kernel.process(run())
    kernel.run()
    trace.close()
    changes = read(io.BytesIO(stream.getvalue().encode()))
    assert changes["firmware.task"][-1] == (1000, "BUSY")
    assert changes["firmware.n"][-1] == (1000, 5)
    assert changes["i2c.transfer"][-1][1] == "W1a:01,R1a:42"
    assert [value for _, value in changes["i2c.busy"]] == [0, 1, 0]


def test_trace_leaves_nothing_behind():
    kernel = Kernel()
    uart = Uart(kernel, BAUD, lambda _byte: None, lambda: None, silence_bytes=10)
    bus = I2cBus(kernel)
    trace = VcdTrace(io.StringIO(), "board", kernel, {"uart": uart})
    trace.listen(bus)
    assert uart.taps
    assert bus.taps
    trace.close()
    assert uart.taps == bus.taps == []
    assert "step" not in vars(kernel)
