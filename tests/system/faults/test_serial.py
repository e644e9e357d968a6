from collections.abc import Set
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.host.errors import NoAnswerError

from .bench import Bench

#: What the node's flags say of a stray byte, and besides of a frame that never ended.
STRAY = {name: {"UartProtocolError"} for name in ("cubesense", "aramis")}
STRAY |= {"cubestar": {"UART_ProtocolError"}}
ENDLESS = {
    "cubestar": {"UART_MsgIncomplete", "UART_RXTimeout"},
    "cubesense": {"UartMsgIncomplete"},
    "aramis": {"UartIncomplete", "UartTimeout"},
}

#: A telecommand whose value may be another one: name, parameters, and where it can be read back.
SETTINGS: dict[str, tuple[str, dict[str, Any], str, str, float]] = {
    "cubestar": ("setDelayTimerTimeout", {"Time": 3}, "DelayTime", "Timeout", 7),
    "cubesense": ("DetectionThreshold2", {"Threshold": 80}, "Configuration", "Threshold2", 84),
    "aramis": ("SetReloadPeriod", {"Period": 16}, "ReloadSettings", "Period", 20),
}

ASK = b"\x80"  # requests telemetry Identification


def check_answers(bench: Bench, flags: Set[str] = frozenset()) -> None:
    bench.faults.clear()
    bench.plug_in()
    assert bench.telemetry("Identification")["InterfaceVersion"] == bench.interface.version
    assert bench.flags() == flags


@pytest.mark.fault("uart-drop")
def test_byte_lost_to_the_device_is_a_protocol_error(bench: Bench) -> None:
    wire = bench.wire()
    bench.inject("uart-drop", direction="to-device", for_s=bench.byte_s / 2)
    assert wire.ask(ASK) == b""
    assert wire.asked == encode_frame(ASK)[1:]
    assert bench.said() == ["0x1f to-device lost"]
    check_answers(bench, STRAY[bench.name])


@pytest.mark.fault("uart-drop")
def test_byte_lost_to_the_host_is_retried(bench: Bench) -> None:
    wire = bench.wire()
    bench.inject("uart-drop", direction="to-host", rate=0.2)
    answers = [wire.ask(ASK) for _ in range(5)]
    assert len(bench.faults.log) > 3
    assert sum(map(len, answers)) < 5 * len(wire.answered)
    client = bench.plug_in(retries=9)
    bench.faults.clear()
    bench.inject("uart-drop", direction="to-host", rate=0.03)
    for _ in range(10):
        assert client.telemetry("Identification")["InterfaceVersion"] == bench.interface.version
    check_answers(bench)


@pytest.mark.fault("uart-corrupt")
def test_corrupted_byte_to_the_host_is_reported(bench: Bench) -> None:
    wire = bench.wire()
    bench.inject("uart-corrupt", direction="to-host", mask=0x80)
    assert bytes(byte ^ 0x80 for byte in wire.ask(ASK)) == wire.answered
    check_answers(bench)


@pytest.mark.fault("uart-corrupt")
def test_corrupted_byte_to_the_device_is_rejected(bench: Bench) -> None:
    wire = bench.wire()
    bench.inject("uart-corrupt", direction="to-device", mask=0xFF)
    assert wire.ask(ASK) == b""
    assert bytes(byte ^ 0xFF for byte in wire.asked) == encode_frame(ASK)
    check_answers(bench, STRAY[bench.name])


@pytest.mark.fault("uart-corrupt")
def test_corrupted_parameter_within_limits_is_accepted(bench: Bench) -> None:
    command, parameters, frame, field, changed = SETTINGS[bench.name]
    client = bench.plug_in()
    fourth = {"after_s": 2.5 * bench.byte_s, "for_s": bench.byte_s}  # byte: the parameter
    bench.inject("uart-corrupt", direction="to-device", mask=0x04, **fourth)
    client.command(command, **parameters)
    bench.faults.clear()
    client.wait_processed(1.0)
    assert len(bench.faults.log) == 1
    assert client.telemetry(frame)[field] == pytest.approx(changed)
    assert bench.flags() == set()


@pytest.mark.fault("uart-delay")
def test_delayed_byte_delays_the_answer(bench: Bench) -> None:
    lasted = []
    for delay_ms in (0.0, 5.0, 12.0):
        wire = bench.wire()
        bench.inject("uart-delay", delay_ms=delay_ms, for_s=bench.byte_s / 2)
        began_s = bench.now_s
        assert len(wire.ask(ASK)) == len(wire.answered) > 8
        lasted.append(bench.now_s - began_s)
    assert np.diff(lasted) == pytest.approx([0.005, 0.007], abs=1e-9)
    check_answers(bench)


@pytest.mark.fault("uart-delay")
def test_message_delayed_in_the_middle_times_out(bench: Bench) -> None:
    client = bench.plug_in()
    in_it = {"after_s": 2.5 * bench.byte_s, "for_s": 0.05}
    bench.inject("uart-delay", direction="to-device", delay_ms=60, **in_it)
    with pytest.raises(NoAnswerError):
        client.telemetry("Identification")
    check_answers(bench, STRAY[bench.name] | ENDLESS[bench.name])
