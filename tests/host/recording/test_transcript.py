import csv
import json
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.formats.recording import (
    BusMessage,
    BusTransfer,
    LineBytes,
    Recording,
    load_recording,
)
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.devices.registry import device, device_names
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.records import start_recorder
from cubestack.host.recording.transcript import COLUMNS, LINE, TranscriptEntry, transcript
from tests.conftest import Run
from tests.together import together

INTERFACE, CUBESTAR = (device(name).interface for name in ("cubesense", "cubestar"))
CONFIGURATION = INTERFACE.telemetry("Configuration")
THRESHOLD = INTERFACE.telecommand("DetectionThreshold1")
BYTE_PS = 173_611_111


def on_the_line(*frames: tuple[str, bytes]) -> list[TranscriptEntry]:
    blocks = [
        LineBytes(index * 10**12, LINE, side, encode_frame(payload), BYTE_PS)  # type: ignore[arg-type]
        for index, (side, payload) in enumerate(frames)
    ]
    return transcript(Recording("a", "cubesense", {LINE: 57600}, tuple(blocks)), INTERFACE)


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.parametrize("name", device_names())
def test_transcript_has_all_answers_of_the_clients(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.rec"
    with open_device(name, seed=2) as opened, path.open("w") as stream:
        recorder = start_recorder(opened, stream)
        interface = opened.device.interface
        bus = opened.board.i2c()
        clients = (opened.client.client, I2cClient(bus, interface, wait=bus.wait))
        asked = [one.name for one in interface.telemetries if one.supported and one.length]
        got = [(one, client.telemetry(one)) for client in clients for one in asked]
        recorder.close()
    found = transcript(load_recording(path), interface)
    assert [(one.name, dict(one.values)) for one in found if not one.error] == got
    assert {one.port for one in found} == {"uart", "i2c"}


def test_telecommand_has_parameters_and_acknowledge() -> None:
    request = bytes([THRESHOLD.id]) + THRESHOLD.pack(Threshold=9)
    code = next(iter(INTERFACE.ack_errors))
    good, bad = on_the_line(
        ("host", request), ("device", b"\0"), ("host", request), ("device", b"\1")
    )
    assert (good.kind, good.name, good.error) == ("telecommand", "DetectionThreshold1", "")
    assert good.values == bad.values == {"Threshold": 9}
    assert good.time_s == pytest.approx(len(encode_frame(request)) * BYTE_PS / 1e12)
    assert bad.error == type(code)(1).name


@pytest.mark.parametrize(
    ("frames", "error"),
    [
        ([("host", bytes([CONFIGURATION.id]))], "no answer"),
        ([("host", bytes([CONFIGURATION.id])), ("device", b"ab")], "2 bytes, not "),
        ([("host", bytes([THRESHOLD.id, 9]))], "no acknowledge"),
        ([("host", bytes([THRESHOLD.id, 9])), ("device", b"abc")], "an acknowledge of 3 bytes"),
        ([("host", bytes([THRESHOLD.id, 9])), ("device", b"\xfe")], "error 254"),
        ([("host", bytes([THRESHOLD.id]) + b"abcdef"), ("device", b"\0")], "6 bytes, not "),
        ([("host", b"\x7e")], "not in the tables"),
        ([("host", b"")], "not in the tables"),
    ],
)
def test_transcript_reports_protocol_errors(frames: list[tuple[str, bytes]], error: str) -> None:
    (one,) = on_the_line(*frames)
    assert one.error.startswith(error)


def test_answer_belongs_to_the_previous_request() -> None:
    answer = ("device", bytes(CONFIGURATION.length))
    ask = ("host", bytes([CONFIGURATION.id]))
    lost, late = on_the_line(answer, ask, ask, answer, answer)
    assert (lost.error, late.error) == ("no answer", "")


def test_other_devices_on_the_bus_are_ignored() -> None:
    def transfer(address: int, errno: int) -> BusTransfer:
        ask = BusMessage(address, bytes([CONFIGURATION.id]), read=False)
        answer = BusMessage(address, b"" if errno else bytes(CONFIGURATION.length), read=True)
        return BusTransfer(10**12, "i2c", 2 * 10**12, (ask, answer), errno)

    own, other = INTERFACE.i2c_address, INTERFACE.i2c_address + 8
    events = (transfer(own, 0), transfer(other, 0), transfer(own, 6))
    good, bad = transcript(Recording("a", "cubesense", events=events), INTERFACE)
    assert (good.time_s, good.port, good.error) == (1.0, "i2c", "")
    assert list(good.values) == [one.name for one in CONFIGURATION.fields]
    assert (bad.error, bad.values) == ("errno 6", {})


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "a.rec"
    spoken = (
        (10**12, "host", bytes([CONFIGURATION.id])),
        (2 * 10**12, "device", bytes(CONFIGURATION.length)),
        (3 * 10**12, "host", bytes([THRESHOLD.id, 9])),
    )
    lines: list[object] = [{"recording": 1, "device": "cubesense", "lines": {LINE: 57600}}]
    lines += (
        {"ps": at, "port": LINE, "from": side, "data": encode_frame(data).hex(), "byte_ps": 1}
        for at, side, data in spoken
    )
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def test_decode_writes_one_row_per_field(run: Run, recording: Path, tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow.parquet")
    for end in ("csv", "parquet"):
        assert run("decode", recording, "--out", tmp_path / f"a.{end}").code == 0
    with (tmp_path / "a.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    columns = arrow.read_table(tmp_path / "a.parquet").to_pylist()
    assert list(rows[0]) == list(columns[0]) == list(COLUMNS)
    for table in (rows, columns):
        assert [row["field"] for row in table[:-1]] == [one.name for one in CONFIGURATION.fields]
        assert [float(row["value"]) for row in table[:-1]] == [0.0] * (len(table) - 1)
        assert (table[-1]["message"], table[-1]["field"]) == ("DetectionThreshold1", "Threshold")
        assert (table[-1]["error"], float(table[-1]["value"])) == ("no acknowledge", 9.0)


def test_decode_prints_text_and_json(run: Run, recording: Path) -> None:
    first, second = run("decode", recording).out.splitlines()
    assert "telemetry Configuration: " in first
    assert second.endswith("telecommand DetectionThreshold1 (no acknowledge): Threshold 9 DN")
    objects = [json.loads(line) for line in run("decode", recording, "--json").out.splitlines()]
    assert objects[1]["values"] == {"Threshold": 9}


def test_decode_rejects_other_file_types(run: Run, recording: Path) -> None:
    assert "a.xls: a table is .csv or .parquet" in run("decode", recording, "--out", "a.xls").line


MESSAGES = [
    pytest.param(device(name).interface, message, id=f"{name}-{message.name}")
    for name in device_names()[:3]
    for message in device(name).interface.telemetries
    if message.supported and message.fields
]


def transfer(interface: Interface, *parts: tuple[bytes, bool], port: str = "i2c") -> BusTransfer:
    messages = tuple(BusMessage(interface.i2c_address, data, read=read) for data, read in parts)
    return BusTransfer(3 * 10**12, port, 4 * 10**12, messages, 0)


def told(interface: Interface, *transfers: BusTransfer) -> list[TranscriptEntry]:
    return transcript(Recording("a", "any", events=transfers), interface)


@together(("interface", "message"), MESSAGES)
def test_each_field_has_a_number_or_text_and_a_unit(interface: Interface, message: Message) -> None:
    reset = message.reset_values()
    asked = (bytes([message.id]), False), (message.pack(**reset), True)
    (one,) = told(interface, transfer(interface, *asked))
    rows = one.rows()
    assert [row["field"] for row in rows] == [field.name for field in message.fields]
    for row, field in zip(rows, message.fields, strict=True):
        assert set(row) == set(COLUMNS)
        assert (row["time_s"], row["port"], row["message"]) == (3.0, "i2c", message.name)
        assert row["unit"] == field.unit
        value: Any = one.values[field.name]
        if isinstance(value, bytes):
            assert row["value"] is None
            assert row["text"]
        else:
            assert row["value"] == float(value)
            assert bool(row["text"]) == (field.choices is not None)
            if field.choices is not None:
                assert row["text"] == field.label(value)


def test_message_without_values_has_one_row() -> None:
    (row,) = TranscriptEntry(1.5, "uart", "unknown", "77", error="not in the tables").rows()
    values = {"time_s": 1.5, "port": "uart", "kind": "unknown", "message": "77"}
    assert row == dict.fromkeys(COLUMNS) | values | {"error": "not in the tables"}


def test_read_without_a_request_is_ignored() -> None:
    assert told(CUBESTAR, transfer(CUBESTAR, (b"abc", True))) == []
    (one,) = told(CUBESTAR, transfer(CUBESTAR, (b"\x7e", False)))
    assert (one.kind, one.name, one.error) == ("unknown", "126", "not in the tables")


def test_telecommand_on_the_bus_has_its_parameters() -> None:
    message = CUBESTAR.telecommand("setIDMode")
    data = bytes([message.id]) + message.pack(**message.reset_values())
    (one,) = told(CUBESTAR, transfer(CUBESTAR, (data, False)))
    assert (one.kind, one.name) == ("telecommand", "setIDMode")
    assert one.values == message.reset_values()
    (short,) = told(CUBESTAR, transfer(CUBESTAR, (data + b"x", False)))
    assert short.error == f"{len(data)} bytes, not {len(data) - 1}"
