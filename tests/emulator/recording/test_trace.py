"""Traces against an independent reader of VCD files and a receiver; a scope against the memory."""

import io
import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.recording.scope import Scope
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.sim.virtual_time import Kernel

from ..bus.ends import Desk, Memory
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
def test_traced_line_levels_encode_the_bytes(writes):
    desk, stream = Desk(BAUD), io.StringIO()
    kernel, uart = desk.kernel, desk.uart
    uart.on_byte = lambda byte: uart.send(bytes([byte ^ 0xFF]))
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


def test_trace_counts_framing_errors_in_a_word():
    desk, stream = Desk(BAUD), io.StringIO()
    trace = VcdTrace(stream, "board", desk.kernel, {"uart": desk.uart})
    desk.uart.host_form = LineFormat(BAUD, parity="S")
    desk.uart.host_writes(b"bc")
    desk.kernel.run()
    trace.close()
    text = stream.getvalue()
    changes = read(io.BytesIO(text.encode()))
    assert [int(value) for _, value in changes["uart.framing_errors"]] == [0, 1, 2]
    bits = {name: int(size) for size, name in re.findall(r"\$var wire (\d+) \S+ (\w+)", text)}
    assert bits == {"rx": 1, "tx": 1, "rx_byte": 8, "tx_byte": 8, "framing_errors": 32}


def test_trace_records_probes_and_i2c_transfers():
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


def test_closed_trace_removes_its_taps():
    desk = Desk(BAUD)
    bus = I2cBus(desk.kernel)
    trace = VcdTrace(io.StringIO(), "board", desk.kernel, {"uart": desk.uart})
    trace.listen(bus)
    assert desk.uart.taps
    assert bus.taps
    trace.close()
    assert desk.uart.taps == bus.taps == []
    assert "step" not in vars(desk.kernel)


PINS = ("DCLK", "DATA", "SRAM_A", "SRAM_OE_N")
STEP_PS, PERIOD_PS, BYTES = 10_000, 770_000, 40


def reading() -> RtlEngine:
    """An engine whose memory holds the numbers from 1 on, in read mode."""
    engine = make_engine(cubestar_wiring())
    engine.sram[:BYTES] = np.arange(1, BYTES + 1)
    engine.run(1_000_000)
    engine.set_pin("RNW", 1)
    engine.set_pin("ENABLE", 1)
    engine.run(2_000_000)
    return engine


def strobed(engine: RtlEngine) -> list[int]:
    out = np.zeros(BYTES, np.uint8)
    assert engine.strobe_read(out, Fraction(PERIOD_PS), 10**9) == BYTES
    return [int(byte) for byte in out]


@pytest.mark.parametrize("clocks", [3, BYTES, 2 * BYTES])
def test_scope_records_every_data_clock_without_changing_the_data(clocks: int) -> None:
    engine = reading()
    start = engine.now_ps
    scope = Scope(engine, PINS, start, start + clocks * PERIOD_PS, STEP_PS)
    assert strobed(engine) == [*range(1, BYTES + 1)]
    engine.run(start + 2 * BYTES * PERIOD_PS)
    scope.close()
    rises = [time for time, level in scope.changes["DCLK"] if level]
    seen = min(clocks, BYTES)
    assert len(rises) in (seen, seen + 1)  # the next one may be at the window's end
    for byte, time_ps in enumerate(rises[:seen]):
        assert 0 <= time_ps - start - byte * PERIOD_PS <= STEP_PS
    assert [level for _, level in scope.changes["DATA"]][1 : seen + 1] == [*range(1, seen + 1)]
    assert engine.now_ps == start + 2 * BYTES * PERIOD_PS


def test_closed_scope_does_not_change_the_simulation() -> None:
    engine, other = reading(), reading()
    now = engine.now_ps
    Scope(engine, PINS, now, now + PERIOD_PS, STEP_PS).close()
    assert strobed(engine) == strobed(other)
    assert engine.now_ps == other.now_ps


def test_scope_rejects_empty_or_past_windows() -> None:
    engine = reading()
    for start, end, step in ((0, 10**9, 1), (10**9, 10**9, 1), (10**9, 10**10, 0)):
        with pytest.raises(ValueError, match="empty or past scope window"):
            Scope(engine, PINS, start, end, step)
