"""Recordings as files: what is written is read; what is no recording says so in one line."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.firmware_model.formats import byte_names, recording
from cubestack.firmware_model.formats.recording import BusMessage, BusTransfer, LineBytes, Recording
from cubestack.firmware_model.formats.setup import Document, Setup
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR

TEXTS = st.text(max_size=30)
TIMES = st.integers(0, 10**15)
UART, I2C = st.just("uart"), st.just("i2c")
ENDS, DATA = st.sampled_from(["host", "device"]), st.binary(min_size=1, max_size=9)
LINES = st.builds(recording.LineBytes, TIMES, UART, ENDS, DATA, st.integers(1, 10**9))
WORDS = st.builds(recording.BusMessage, st.integers(0, 127), st.binary(max_size=5), st.booleans())
MESSAGES = st.lists(WORDS, max_size=3).map(tuple)
TRANSFERS = st.builds(recording.BusTransfer, TIMES, I2C, TIMES, MESSAGES, st.integers(0, 130))
FILES = st.dictionaries(st.sampled_from(["a.png", "b"]), st.binary(max_size=9))
CONTROLS = st.builds(recording.Control, TIMES, st.lists(TEXTS).map(tuple), TEXTS, FILES)
EVENTS = LINES | TRANSFERS | CONTROLS | st.builds(recording.LineError, TIMES, UART)
DOCUMENTS = st.none() | st.builds(Document, TEXTS, TEXTS, FILES)
OPTIONS = st.dictionaries(TEXTS, st.booleans() | st.integers(-(10**20), 10**20) | TEXTS, max_size=3)
SETUPS = st.builds(
    Setup, TEXTS, st.just(""), st.integers(0, 2**40), DOCUMENTS, DOCUMENTS, OPTIONS, FILES
)


@settings(max_examples=50)
@given(st.lists(EVENTS, max_size=8), st.none() | SETUPS)
def test_recording_events_round_trip(tmp_path_factory, events, setup):
    stream = io.StringIO()
    writer = recording.RecordingWriter(stream, "cubestar", {"uart": 57_600}, setup)
    for event in events:
        writer.write(event)
    writer.end()
    path = tmp_path_factory.getbasetemp() / "some.rec"
    path.write_text(stream.getvalue(), encoding="utf-8")
    found = recording.load_recording(path)
    assert found.whole
    assert (found.device, found.bauds) == ("cubestar", {"uart": 57_600})
    assert found.setup == setup
    assert list(found.events) == sorted(events, key=lambda event: event.time_ps)


@given(st.lists(EVENTS, max_size=8), st.data())
def test_recording_that_was_cut_off_has_its_whole_events(tmp_path_factory, events, data):
    stream = io.StringIO()
    writer = recording.RecordingWriter(stream, "cubestar", {"uart": 57_600})
    header = len(stream.getvalue())
    ends = [header]
    for event in events:
        writer.write(event)
        ends.append(len(stream.getvalue()))
    writer.end()
    length = data.draw(st.integers(header, len(stream.getvalue()) - 2))
    path = tmp_path_factory.getbasetemp() / "cut.rec"
    path.write_text(stream.getvalue()[:length], encoding="utf-8")
    found = recording.load_recording(path)
    count = sum(end - 1 <= length for end in ends[1:])  # the end of its line may be missing
    assert list(found.events) == sorted(events[:count], key=lambda event: event.time_ps)
    assert not found.whole


HEADER = '{"recording": 1, "device": "x", "lines": {"uart": 1200}}\n'
EVENT = '{"ps": 1, "port": "uart", "from": "%s", "data": "%s", "byte_ps": 1}'


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it is empty"),
        ("hello", "line 1: not valid JSON: Expecting value"),
        (
            '{"recording": 3}',
            "line 1: the recording has version 3, this program reads 1 and 2; update cubestack",
        ),
        ('{"recording": 0}', "make the recording again"),
        ('{"recording": "2"}', "must be a whole number, not '2'"),
        ('{"recording": 1}', "line 1: lacks 'lines'"),
        ("[]", "line 1: a line must be an object"),
        (HEADER + '{"ps": 1}', "line 2: lacks 'port'"),
        (HEADER + '{"ps": 1\n', "line 2: not valid JSON: Expecting"),
        (HEADER + '{"events": 1}', "line 2: it ends after 0 events, not 1"),
        (HEADER + EVENT % ("me", ""), 'line 2: "from" must be'),
        (HEADER + EVENT % ("host", "xy"), "line 2: non-hexadecimal"),
        (HEADER + EVENT.replace("1,", "-1,", 1) % ("host", ""), '"ps" must be a whole number in 0'),
        (HEADER + EVENT.replace("uart", "line") % ("host", ""), "no line 'line'"),
        (HEADER + EVENT.replace(": 1}", ": 0}") % ("host", ""), '"byte_ps" must be'),
        (HEADER + '{"ps": 1, "control": "abc"}', '"control" must be a list'),
        (HEADER + '{"ps": 1e400, "control": []}\n', "no finite number"),
        (HEADER + '{"ps": 1, "control": [], "files": {"../x": ""}}', "no name of a file"),
        (HEADER + '{"ps": 1, "control": [], "files": {"x": "?"}}', "base 64"),
        (HEADER + "[" * 100_000 + "\n", "line 2: lists and tables are nested"),
        (HEADER.replace("1200", "0"), '"uart" must be a whole number in 1'),
        ("\x00\xff\n" * 3, "line 1: "),
    ],
)
def test_rejects_files_that_are_not_recordings(tmp_path, text, reason):
    path = tmp_path / "some.rec"
    path.write_text(text)
    with pytest.raises(recording.RecordingError, match=reason) as raised:
        recording.load_recording(path)
    assert "\n" not in str(raised.value)
    assert "some.rec" in str(raised.value)


def test_recording_until_a_time_includes_events_at_that_time():
    begun = [recording.LineError(time_ps, "uart") for time_ps in (5, 10, 11)]
    whole = recording.Recording("a", "cubestar", events=tuple(begun))
    for end_ps, count in ((4, 0), (10, 2), (11, 3)):
        assert whole.until(end_ps).events == tuple(begun[:count])


def test_recording_of_a_real_device_has_no_setup():
    setup = Setup("1.0", target="/dev/ttyUSB0", seed=3)
    assert setup.to_json() == {"version": "1.0", "target": "/dev/ttyUSB0"}
    assert Setup.from_json(setup.to_json()) == Setup("1.0", target="/dev/ttyUSB0")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ([], '"setup" must be an object'),
        ({"sede": 1}, "no member 'sede'"),
        ({"seed": -1}, "whole number from 0, not -1"),
        ({"seed": True}, "whole number from 0, not True"),
        ({"scene": "sky.toml"}, '"scene" must be an object'),
        ({"faults": {"text": 1}}, '"text" must be a text, not 1'),
        ({"options": {"x": []}}, '"options" must be an object'),
    ],
)
def test_rejects_inconsistent_setups(content, reason):
    with pytest.raises(ValueError, match=reason):
        Setup.from_json(content)


def exchanged(*exchanges: tuple[bytes, bytes], port: str = "uart") -> Recording:
    ends = ("host", "device")
    sides = [side for exchange in exchanges for side in zip(ends, exchange, strict=True)]
    events = (LineBytes(5000 * at, port, *side, 1) for at, side in enumerate(sides))
    return Recording("test", "cubesense", {port: 1}, tuple(events))


@given(st.binary(max_size=12), st.binary(max_size=6).map(encode_frame))
def test_payload_offset_follows_the_encoder(payload, before):
    """Oracle: where the encoder puts each byte, one by one."""
    wire, position = before + encode_frame(payload), len(before) + 2
    for offset, byte in enumerate(payload):
        for _ in range(2 if byte == 0x1F else 1):
            assert byte_names.payload_offset(wire, position) == offset
            position += 1
    assert byte_names.payload_offset(wire, position) is None
    assert byte_names.payload_offset(wire, len(before)) is None


@pytest.mark.parametrize("interface", [INTERFACE, CUBESTAR], ids=lambda one: one.name)
def test_every_telemetry_field_is_found(interface):
    for message in interface.telemetries:
        if not message.supported:
            continue
        answer = encode_frame(bytes(message.length))
        whole = exchanged((encode_frame(bytes([message.id])), answer))
        for field in message.fields:
            index = 2 + field.bit_offset // 8
            name = byte_names.name_answer_byte(interface, whole, "uart", index)
            assert f"telemetry {message.name}, field" in name
            assert field.name in name


def test_answers_belong_to_the_request_before_them():
    whole = exchanged(
        (encode_frame(b"\x80"), encode_frame(bytes(8))),
        (encode_frame(b"\x14\0\0"), encode_frame(b"\0")),
    )
    for index, name in (
        (4, "telemetry Identification, field FirmwareVersionMajor"),
        (14, "acknowledge of telecommand CaptureAndDetect, error code"),
        (12, "framing"),
    ):
        assert byte_names.name_answer_byte(INTERFACE, whole, "uart", index).endswith(name)


def test_bench_letter_is_named():
    both = exchanged((b"a", b"Y"), (b"q", b"YY"), port="bench_uart")
    for index, letter in enumerate("aqq"):
        name = byte_names.name_answer_byte(INTERFACE, both, "bench_uart", index)
        assert name.endswith(f"answer to letter '{letter}'")


def test_request_bytes_are_named_after_message_fields():
    wire = encode_frame(b"\x80") + encode_frame(bytes([20, 1, 0]))
    names = [byte_names.name_request_byte(INTERFACE, wire, index, "uart") for index in (7, 8, 9, 5)]
    assert names[0].endswith("the ID")
    assert names[1].endswith("telecommand CaptureAndDetect, field Camera")
    assert names[2].endswith("telecommand CaptureAndDetect, field Sram")
    assert names[3].endswith("outside of a frame's payload")


@pytest.mark.parametrize(
    ("address", "pointer", "index", "name"),
    [
        (0x1B, 0x80, 2, "telemetry Identification, field FirmwareVersionMajor"),
        (0x1B, 0xFE, 0, "unknown ID 254"),
        (0x1C, 0x00, 0, "register SUN_THRESHOLD"),
    ],
)
def test_bus_bytes_are_named_after_messages_and_registers(address, pointer, index, name):
    sent, read = bytes([pointer]), bytes(8)
    messages = BusMessage(address, sent, read=False), BusMessage(address, read, read=True)
    transfer = BusTransfer(0, "i2c", 1, messages)
    assert byte_names.name_bus_byte(INTERFACE, transfer, 1, index).endswith(name)
