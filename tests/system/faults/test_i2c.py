import errno
from collections.abc import Set

import pytest
from smbus2 import i2c_msg

from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.host.clients.i2c import I2cClient

from .bench import Bench
from .test_serial import SETTINGS

BIT_S = 1e-5
BYTE_S, ADDRESS_S = 9 * BIT_S, 10 * BIT_S

WHOLE = ["S w", "80", "S r", "P"]  # a complete request at the node's end


def usual_s(bench: Bench) -> float:
    began_s = bench.now_s
    bench.ask_i2c()
    return bench.now_s - began_s


def check_refused(bench: Bench, number: int, message: str) -> list[str]:
    """Checks that a request fails; returns what the node's end saw."""
    spy = bench.spy()
    with pytest.raises(OSError, match=message) as failure:
        bench.ask_i2c()
    assert failure.value.errno == number
    return spy.seen


def check_works(bench: Bench, flags: Set[str] = frozenset()) -> None:
    bench.faults.clear()
    assert bench.ask_i2c()[0] == bench.telemetry("Identification")["NodeType"]
    assert bench.flags() == flags


@pytest.mark.fault("i2c-nack")
def test_address_without_acknowledge_is_not_seen_by_the_node(bench: Bench) -> None:
    bench.inject("i2c-nack")
    assert check_refused(bench, errno.ENXIO, "no I2C device answers") == []
    assert bench.said() == ["address not acknowledged"]
    check_works(bench)


@pytest.mark.fault("i2c-nack")
def test_client_retries_addresses_without_acknowledge(bench: Bench) -> None:
    bus = bench.board.i2c()
    client = I2cClient(bus, bench.interface, wait=bus.wait, retries=9)
    bench.inject("i2c-nack", rate=0.4)
    for _ in range(10):
        assert client.telemetry("Identification")["InterfaceVersion"] == bench.interface.version
    assert len(bench.faults.log) > 3
    check_works(bench)


@pytest.mark.fault("i2c-nack")
def test_byte_without_acknowledge_truncates_a_telecommand(bench: Bench) -> None:
    command, parameters, frame, field, _ = SETTINGS[bench.name]
    message = bench.interface.telecommand(command)
    before = bench.telemetry(frame)[field]
    spy = bench.spy()
    bench.inject("i2c-nack", on="byte", after_s=ADDRESS_S + 1.5 * BYTE_S)
    data = bytes([message.id]) + message.pack(**parameters)
    with pytest.raises(OSError, match="did not acknowledge a byte") as failure:
        bench.board.i2c().i2c_rdwr(i2c_msg.write(bench.interface.i2c_address, data))
    assert failure.value.errno == errno.EIO
    assert spy.seen == ["S w", f"{message.id:02x}", "P"]
    flags = {"cubestar": {"I2C_TCMD_TooFewParm"}, "aramis": {"TcmdLengthError"}}
    check_works(bench, flags.get(bench.name, set()))
    assert bench.telemetry(frame)[field] == before
    if bench.name != "cubestar":
        assert bench.telemetry("TcmdProcessed")["Error"] == AckError.WRONG_LENGTH


@pytest.mark.fault("i2c-stretch")
def test_stretched_clock_delays_the_transfer(bench: Bench) -> None:
    lasted_s = usual_s(bench)
    spy, began_s = bench.spy(), bench.now_s
    bench.inject("i2c-stretch", stretch_us=700)
    answer = bench.ask_i2c()
    bytes_in_all = 1 + len(answer)
    assert bench.now_s - began_s == pytest.approx(lasted_s + bytes_in_all * 700e-6, abs=1e-9)
    assert bench.said() == ["700 us"] * bytes_in_all
    assert spy.seen == WHOLE
    check_works(bench)


@pytest.mark.fault("i2c-stretch")
def test_clock_stretched_over_1_s_times_out(bench: Bench) -> None:
    began_s = bench.now_s
    bench.inject("i2c-stretch", stretch_us=2e6)
    assert check_refused(bench, errno.ETIMEDOUT, "clock low")[-1] == "P"
    assert 1.0 < bench.now_s - began_s < 1.001
    check_works(bench)


@pytest.mark.fault("i2c-stuck")
@pytest.mark.parametrize("line", ["SDA", "SCL"])
def test_stuck_line_blocks_the_bus(bench: Bench, line: str) -> None:
    bench.inject("i2c-stuck", line=line, for_s=1.3)
    assert check_refused(bench, errno.EBUSY, f"{line} was low for over 1 s") == []
    began_s = bench.now_s
    bench.ask_i2c()
    assert 0.29 < bench.now_s - began_s < 0.31
    check_works(bench)


@pytest.mark.fault("i2c-stuck")
@pytest.mark.parametrize(("line", "number"), [("SDA", errno.EAGAIN), ("SCL", errno.ETIMEDOUT)])
def test_line_stuck_during_a_transfer_aborts_it(bench: Bench, line: str, number: int) -> None:
    bench.inject("i2c-stuck", line=line, after_s=ADDRESS_S + BYTE_S / 2)
    assert check_refused(bench, number, "low") == ["S w", "P"]
    assert bench.said()[0] == f"{line} is low in a transfer"
    check_works(bench)


@pytest.mark.fault("i2c-stuck")
def test_clock_stuck_below_1_s_delays_the_transfer(bench: Bench) -> None:
    lasted_s = usual_s(bench)
    spy, began_s = bench.spy(), bench.now_s
    bench.inject("i2c-stuck", line="SCL", after_s=ADDRESS_S + BYTE_S / 2, for_s=0.5)
    bench.ask_i2c()
    assert bench.now_s - began_s == pytest.approx(lasted_s + 0.5, abs=BYTE_S)
    assert spy.seen == WHOLE
    check_works(bench)
