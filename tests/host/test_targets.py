import os
from unittest.mock import Mock

import pytest

from cubestack.firmware_model.formats import recording
from cubestack.firmware_model.formats.recording import BusMessage, BusTransfer, LineBytes
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.host import targets
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.errors import PortOpenError, RecordingMismatchError, TargetError
from cubestack.host.targets import device_at, open_target
from cubestack.host.transport.streams import Transport


@pytest.mark.parametrize(
    ("text", "device", "error"),
    [
        ("/dev/null0", None, r"/dev/null0 does not name .* add --device \(cubestar, cubesense"),
        ("/dev/null0", "cubestr", "no device 'cubestr'; known: cubestar"),
        ("i2c:7:0x33", None, "add --device"),
    ],
)
def test_rejects_unknown_targets(text, device, error):
    with pytest.raises(TargetError, match=error):
        open_target(text, device)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("./no_such_port", r"can not open ./no_such_port: No such file or directory\Z"),
        ("i2c:250:0x1a", "can not open /dev/i2c-250: No such file"),
        ("recorded:no_such.rec", "can not open no_such.rec: No such file"),
        ("tcp://127.0.0.1:1", r"can not open tcp://127.0.0.1:1: Connection refused\Z"),
        ("rfc2217://127.0.0.1:1", "can not open rfc2217://127.0.0.1:1: Connection refused"),
    ],
)
def test_reports_targets_that_do_not_open(text, error):
    with pytest.raises(PortOpenError, match=error):
        open_target(text, "cubestar")


def write(path, events) -> None:
    bauds = {"uart": 57_600, "bench_uart": 115_200}
    with path.open("w") as stream:
        writer = recording.RecordingWriter(stream, "cubesense", bauds)
        for event in events:
            writer.write(event)


@pytest.mark.parametrize(
    ("text", "device", "name"),
    [
        ("i2c:7:0x1a", None, "cubestar"),
        ("i2c:7:0x1c", None, "cubesense"),
        ("i2c:7:0x20", "aramis", "aramis"),
        ("/dev/ttyUSB0", "cubestar", "cubestar"),
    ],
)
def test_address_or_option_names_the_device(text, device, name):
    assert device_at(text, device).name == name


def test_recording_names_its_device(tmp_path):
    path = tmp_path / "a.rec"
    write(path, [LineBytes(0, "uart", "host", encode_frame(b"\x80"), 1),
                 LineBytes(9, "uart", "device", encode_frame(bytes(8)), 1)])  # fmt: skip
    target = open_target(f"recorded:{path}")
    assert target.interface.name == "CubeSense"
    assert target.node.telemetry("Identification")["NodeType"] == 0
    assert target.service_port is not None
    target.close()


def test_recorded_i2c_bus_opens_as_a_target(tmp_path):
    path = tmp_path / "a.rec"
    messages = (BusMessage(0x1B, b"\x80", False), BusMessage(0x1B, bytes(8), True))
    write(path, [BusTransfer(0, "i2c", 9, messages)])
    target = open_target(f"recorded:{path}")
    assert isinstance(target.node, I2cClient)
    assert target.node.telemetry("Identification")["NodeType"] == 0


def test_empty_i2c_recording_raises_a_mismatch(tmp_path):
    path = tmp_path / "a.rec"
    path.write_text('{"recording":1,"device":"cubesense","lines":{}}\n')
    with pytest.raises(RecordingMismatchError, match="the recording ends after 0 transfers"):
        open_target(f"recorded:{path}").node.telemetry("Identification")


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("i2c:7:0x1a", "--backup is for a serial line, not for i2c:7:0x1a"),
        ("emulated:cubesense", "--backup is for a serial line"),
        ("./tty", "CubeStar has no registers on a UART: leave out --backup"),
    ],
)
def test_backup_option_requires_a_device_with_uart_registers(text, error):
    with pytest.raises(TargetError, match=error):
        open_target(text, "cubestar", backup=True)


def test_rejects_a_service_port_for_a_device_without_one():
    master, slave = os.openpty()
    with pytest.raises(TargetError, match="CubeStar has no bench protocol: leave out --bench"):
        open_target(os.ttyname(slave), "cubestar", service_port="x")
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize("recorded", [False, True])
def test_both_lines_are_recorded_until_closed(tmp_path, monkeypatch, recorded):
    ports = {"a": Mock(Transport), "b": Mock(Transport)}
    ports["a"].read.return_value = b""
    monkeypatch.setattr(targets, "open_transport", lambda text, _baud: ports[text])
    path = tmp_path / "a.rec" if recorded else None
    target = open_target("a", "cubesense", service_port="b", record=path)
    target.service_port.write(b"q")
    ports["b"].write.assert_called_once_with(b"q")
    ports["a"].close.side_effect = lambda: target.line.write(b"bye")
    target.close()
    ports["b"].close.assert_called_once_with()
    if path is not None:
        tape = recording.load_recording(path)
        said = [tape.sent(port, "host")[0] for port in ("uart", "bench_uart")]
        assert said == [b"bye", b"q"]
