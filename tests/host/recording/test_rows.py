from typing import Any

import pytest

from cubestack.firmware_model.formats.recording import BusMessage, BusTransfer, Recording
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.host.devices.registry import device, device_names
from cubestack.host.recording.transcript import COLUMNS, TranscriptEntry, transcript

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


@pytest.mark.parametrize(("interface", "message"), MESSAGES)
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
    interface = device("cubestar").interface
    assert told(interface, transfer(interface, (b"abc", True))) == []
    (one,) = told(interface, transfer(interface, (b"\x7e", False)))
    assert (one.kind, one.name, one.error) == ("unknown", "126", "not in the tables")


def test_telecommand_on_the_bus_has_its_parameters() -> None:
    interface = device("cubestar").interface
    message = interface.telecommand("setIDMode")
    data = bytes([message.id]) + message.pack(**message.reset_values())
    (one,) = told(interface, transfer(interface, (data, False)))
    assert (one.kind, one.name, dict(one.values)) == (
        *("telecommand", "setIDMode"),
        message.reset_values(),
    )
    (short,) = told(interface, transfer(interface, (data + b"x", False)))
    assert short.error == f"{len(data)} bytes, not {len(data) - 1}"
