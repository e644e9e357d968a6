"""Bytes get the names of their fields; oracle: the tables' own offsets."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.formats import byte_names
from cubestack.firmware_model.formats.recording import BusMessage, BusTransfer, LineBytes, Recording
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR


def recording(*exchanges: tuple[bytes, bytes], port: str = "uart") -> Recording:
    events = []
    for number, (request, answer) in enumerate(exchanges):
        start_ps = number * 10_000
        events += [
            LineBytes(start_ps, port, "host", request, 1),
            LineBytes(start_ps + 5000, port, "device", answer, 1),
        ]
    return Recording("test", "cubesense", {port: 1}, tuple(events))


@given(st.binary(max_size=12), st.binary(max_size=6).map(encode_frame))
def test_offset_of_every_payload_byte(payload, before):
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
        whole = recording((encode_frame(bytes([message.id])), answer))
        for field in message.fields:
            index = 2 + field.bit_offset // 8
            name = byte_names.name_answer_byte(interface, whole, "uart", index)
            assert f"telemetry {message.name}, field" in name
            assert field.name in name


def test_answers_belong_to_the_request_before_them():
    whole = recording(
        (encode_frame(b"\x80"), encode_frame(bytes(8))),
        (encode_frame(b"\x14\0\0"), encode_frame(b"\0")),
    )
    assert byte_names.name_answer_byte(INTERFACE, whole, "uart", 4).endswith(
        "telemetry Identification, field FirmwareVersionMajor"
    )
    assert byte_names.name_answer_byte(INTERFACE, whole, "uart", 14).endswith(
        "acknowledge of telecommand CaptureAndDetect, error code"
    )
    assert byte_names.name_answer_byte(INTERFACE, whole, "uart", 12).endswith("framing")


def test_bench_letter_is_named():
    whole = recording((b"q", b"Y"), port="bench_uart")
    assert byte_names.name_answer_byte(INTERFACE, whole, "bench_uart", 0).endswith(
        "answer to letter 'q'"
    )
    both = recording((b"a", b"Y"), (b"q", b"YY"), port="bench_uart")
    assert [
        byte_names.name_answer_byte(INTERFACE, both, "bench_uart", index)[-3:] for index in range(3)
    ] == ["'a'", "'q'", "'q'"]


def test_request_byte_is_named():
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
def test_bus_byte_is_named(address, pointer, index, name):
    messages = (
        BusMessage(address, bytes([pointer]), read=False),
        BusMessage(address, bytes(8), read=True),
    )
    transfer = BusTransfer(0, "i2c", 1, messages)
    assert byte_names.name_bus_byte(INTERFACE, transfer, 1, index).endswith(name)
