from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest
from smbus2 import i2c_msg

from cubestack.firmware_model.formats.recording import (
    BusMessage,
    BusTransfer,
    LineBytes,
    Recording,
    load_recording,
)
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import NoAnswerError, RecordingMismatchError
from cubestack.host.recording.host_recorder import HostRecorder
from cubestack.host.recording.playback import RecordedI2c, RecordedTransport

IDENTIFICATION = bytes([4, 2, 3, 9, 1, 0, 2, 0])


def line(*exchanges: tuple[bytes, bytes]) -> Recording:
    events = []
    for number, (request, answer) in enumerate(exchanges):
        start_ps = number * 10_000
        events.append(LineBytes(start_ps, "uart", "host", encode_frame(request), 1))
        if answer:
            events.append(LineBytes(start_ps + 500, "uart", "device", encode_frame(answer), 1))
    return Recording("a.rec", "cubesense", {"uart": 57_600}, tuple(events))


def client(recording: Recording) -> NodeClient:
    return NodeClient(RecordedTransport(recording, INTERFACE), INTERFACE, retries=0)


def test_node_client_runs_on_a_recording():
    node = client(line((b"\x80", IDENTIFICATION), (b"\x28\x09", b"\0"), (b"\x80", IDENTIFICATION)))
    assert node.telemetry("Identification")["FirmwareVersionMajor"] == 3
    node.command("DetectionThreshold1", Threshold=9)
    assert node.telemetry("Identification")["FirmwareVersionMinor"] == 9


def test_different_parameter_and_end_of_recording_are_named():
    node = client(line((b"\x80", IDENTIFICATION), (b"\x28\x09", b"\0")))
    node.telemetry("Identification")
    where = r"recorded:a\.rec: uart: byte 8 from the host, telecommand DetectionThreshold1, field "
    with pytest.raises(RecordingMismatchError, match=where + "Threshold: 0x0a, recorded 0x09"):
        node.command("DetectionThreshold1", Threshold=10)
    node.command("DetectionThreshold1", Threshold=9)
    with pytest.raises(RecordingMismatchError, match="the recording ends before it"):
        node.telemetry("Identification")


def test_recorded_missing_answer_raises_no_answer_error():
    with pytest.raises(NoAnswerError):
        client(line((b"\x80", b""), (b"\x80", IDENTIFICATION))).telemetry("Identification")


def test_rejects_a_port_that_was_not_recorded():
    with pytest.raises(RecordingMismatchError, match=r"has no line 'bench_uart'; it has: uart"):
        RecordedTransport(line(), INTERFACE, "bench_uart")


def bus(*transfers: tuple[bytes, bytes, int]) -> RecordedI2c:
    events = []
    for number, (written, read, errno) in enumerate(transfers):
        messages = (BusMessage(0x1B, written, False), BusMessage(0x1B, read, True))
        events.append(BusTransfer(number, "i2c", number, messages, errno))
    return RecordedI2c(Recording("a.rec", "cubesense", {}, tuple(events)), INTERFACE)


def test_i2c_client_runs_on_a_recording():
    node = I2cClient(bus((b"\x80", IDENTIFICATION, 0)), INTERFACE, retries=0)
    assert node.telemetry("Identification")["FirmwareVersionMajor"] == 3
    with pytest.raises(RecordingMismatchError, match="the recording ends after 1 transfers"):
        node.telemetry("Identification")


@pytest.mark.parametrize(
    ("messages", "text"),
    [
        ([i2c_msg.write(0x1B, [0x81]), i2c_msg.read(0x1B, 8)], "81, recorded 80"),
        ([i2c_msg.write(0x1B, [0x80])], "has 1 messages, recorded 2"),
        ([i2c_msg.write(0x1C, [0x80]), i2c_msg.read(0x1B, 8)], "write at 0x1c, recorded a write"),
    ],
)
def test_replay_reports_a_different_transfer(messages, text):
    with pytest.raises(RecordingMismatchError, match=text):
        bus((b"\x80", IDENTIFICATION, 0)).i2c_rdwr(*messages)


def test_first_different_byte_of_a_transfer_is_named():
    recorded = BusTransfer(0, "i2c", 0, (BusMessage(0x1B, b"\x28\x09", False),), 0)
    target = RecordedI2c(Recording("a.rec", "cubesense", {}, (recorded,)), INTERFACE)
    different = "DetectionThreshold1, field Threshold: 280a, recorded 2809"
    with pytest.raises(RecordingMismatchError, match=different):
        target.i2c_rdwr(i2c_msg.write(0x1B, [0x28, 0x0A]))


@pytest.fixture
def tape(tmp_path: Path) -> Iterator[HostRecorder]:
    """Records to a.rec; every look at its clock costs 1 ms."""
    looks = count(10**15, 1_000_000)
    with (tmp_path / "a.rec").open("w", buffering=1) as stream:
        made = HostRecorder(stream, clock_ns=lambda: next(looks))
        made.begin("cubestar", {"uart": 57_600})
        yield made


def session(client: NodeClient | I2cClient) -> list[object]:
    client.command("setDetectionThresholds", DetectionThreshold=7, StarThreshold=8)
    return [CubeStar(client).task_status(), client.telemetry("Identification")]


def test_serial_session(node, uart, tape, tmp_path):
    node.values["TaskStatus"]["taskStatus"] = 1
    before = session(NodeClient(tape.line(uart, "uart", 57_600), CUBESTAR))
    recording = load_recording(tmp_path / "a.rec")
    assert session(NodeClient(RecordedTransport(recording, CUBESTAR), CUBESTAR)) == before


def test_replay_repeats_lost_answers(node, uart, tape, tmp_path):
    node.lost = 2
    line = tape.line(uart, "uart", 57_600)
    before = NodeClient(line, CUBESTAR).telemetry("Identification")
    recording = load_recording(tmp_path / "a.rec")
    replayed = NodeClient(RecordedTransport(recording, CUBESTAR), CUBESTAR)
    assert replayed.telemetry("Identification") == before
    with pytest.raises(RecordingMismatchError, match="the recording ends"):
        replayed.telemetry("Identification")


def test_recorded_i2c_session_replays_with_its_errors(node, i2c, tape, tmp_path):
    node.values["TaskStatus"]["taskStatus"] = 1
    i2c.failures = 1
    bus = tape.bus(i2c)
    with pytest.raises(OSError, match="Remote I/O"):
        bus.i2c_rdwr(i2c_msg.write(i2c.address, [0x80]), i2c_msg.read(i2c.address, 8))
    before = session(I2cClient(bus, CUBESTAR, wait=lambda _s: None))
    recorded = RecordedI2c(load_recording(tmp_path / "a.rec"), CUBESTAR)
    with pytest.raises(OSError, match="failed when it was recorded"):
        recorded.i2c_rdwr(i2c_msg.write(i2c.address, [0x80]), i2c_msg.read(i2c.address, 8))
    assert session(I2cClient(recorded, CUBESTAR, wait=lambda _s: None)) == before


def test_host_recording_times_never_overlap(node, uart, tape, tmp_path):
    client = NodeClient(tape.line(uart, "uart", 57_600), CUBESTAR)
    for _ in range(5):
        client.telemetry("ImageBlock")
    blocks = list(load_recording(tmp_path / "a.rec").line("uart"))
    ends = [block.time_ps + len(block.data) * block.byte_ps for block in blocks]
    assert all(end <= block.time_ps for end, block in zip(ends, blocks[1:], strict=False))
