"""Traces against an independent reader of VCD files, and a receiver on the drawn levels."""

import io
from collections import defaultdict

from hypothesis import given
from hypothesis import strategies as st
from vcd.reader import TokenKind, tokenize

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.emulator.sim.virtual_time import Kernel

BAUD = 57_600


def read(text: str) -> dict[str, list[tuple[int, object]]]:
    """Changes (ns, value) of each variable by its dotted name."""
    names, scope, time_ns = {}, [], 0
    changes: dict[str, list[tuple[int, object]]] = defaultdict(list)
    for token in tokenize(io.BytesIO(text.encode())):
        match token.kind:
            case TokenKind.SCOPE:
                scope.append(token.scope.ident)
            case TokenKind.UPSCOPE:
                scope.pop()
            case TokenKind.VAR:
                names[token.var.id_code] = ".".join([*scope, token.var.reference])
            case TokenKind.CHANGE_TIME:
                assert token.time_change >= time_ns
                time_ns = token.time_change
            case TokenKind.CHANGE_SCALAR:
                change = token.scalar_change
                changes[names[change.id_code]].append((time_ns, change.value))
            case TokenKind.CHANGE_VECTOR:
                change = token.vector_change
                changes[names[change.id_code]].append((time_ns, change.value))
            case TokenKind.CHANGE_STRING:
                change = token.string_change
                changes[names[change.id_code]].append((time_ns, change.value))
    return changes


def received(levels: list[tuple[int, object]]) -> bytes:
    """What a receiver makes of drawn levels."""

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
    changes = read(stream.getvalue())
    assert received(changes["echo.uart.rx"]) == sent
    assert received(changes["echo.uart.tx"]) == bytes(byte ^ 0xFF for byte in sent)


class Target:
    def i2c_start(self, read: bool) -> None:
        pass

    def i2c_write(self, byte: int) -> bool:
        return True

    def i2c_read(self) -> int:
        return 0x42

    def i2c_stop(self) -> None:
        pass


def test_probes_and_transfers():
    kernel, stream, state = Kernel(), io.StringIO(), {"task": "IDLE", "n": 0}
    bus = I2cBus(kernel)
    bus.attach(0x1A, Target())
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
    changes = read(stream.getvalue())
    assert changes["board.firmware.task"][-1] == (1000, "BUSY")
    assert changes["board.firmware.n"][-1] == (1000, 5)
    assert changes["board.i2c.transfer"][-1][1] == "W1a:01,R1a:42"
    busy = [int(value) for _, value in changes["board.i2c.busy"]]
    assert busy == [0, 1, 0]


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
