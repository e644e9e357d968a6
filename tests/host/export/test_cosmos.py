"""Oracle: a reader of COSMOS's documented grammar and bit order."""

import shlex
import struct
from dataclasses import dataclass, field
from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.host.export.cosmos import cosmos
from tests.host.export.frames import EACH, frames, messages, same

MODIFIERS = {"STATE": 2, "UNITS": 2, "POLY_READ_CONVERSION": 2, "POLY_WRITE_CONVERSION": 2}


@dataclass
class Item:
    """One item, parameter or ID parameter, by the words of its line."""

    name: str
    bit: int
    bits: int
    kind: str
    little: bool
    numbers: list[str] = field(default_factory=list)
    modifiers: dict[str, list[list[str]]] = field(default_factory=dict)

    def value(self, data: bytes) -> Any:
        """As COSMOS reads it: offsets count from the highest bit of the first byte."""
        if self.kind == "BLOCK":
            return data[self.bit // 8 : (self.bit + self.bits) // 8]
        if self.bits < 8:
            assert not self.little  # whose offsets would mean something else
            whole = int.from_bytes(data, "big") >> (8 * len(data) - self.bit - self.bits)
            return whole & ((1 << self.bits) - 1)
        assert self.bit % 8 == 0
        part = data[self.bit // 8 : (self.bit + self.bits) // 8]
        if self.kind == "FLOAT":
            return struct.unpack("<f", part)[0]
        raw = int.from_bytes(part, "little", signed=self.kind == "INT")
        for low, factor in self.modifiers.get("POLY_READ_CONVERSION", ()):
            return float(low) + raw * float(factor)
        return raw


Packets = dict[tuple[str, str], dict[str, Item]]


def parse(text: str) -> Packets:
    """Packets by keyword and name; fails for other grammar."""
    packets: Packets = {}
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if not words:
            continue
        keyword, *rest = words
        if keyword in ("COMMAND", "TELEMETRY"):
            target, name, endianness, _ = rest
            assert (target == target.upper(), endianness) == (True, "LITTLE_ENDIAN")
            assert (keyword, name) not in packets
            items = packets[keyword, name] = {}
        elif keyword in ("ITEM", "PARAMETER", "ID_PARAMETER"):
            name, bit, bits, kind, *numbers, _, endianness = rest
            expected = {"ITEM": 0, "ID_PARAMETER": 3, "PARAMETER": 1 if kind == "BLOCK" else 3}
            assert len(numbers) == expected[keyword]
            assert kind in ("INT", "UINT", "FLOAT", "BLOCK")
            assert name not in items
            little = {"LITTLE_ENDIAN": True, "BIG_ENDIAN": False}[endianness]
            item = items[name] = Item(name, int(bit), int(bits), kind, little, numbers)
        else:
            assert len(rest) == MODIFIERS[keyword]
            item.modifiers.setdefault(keyword, []).append(rest)
    return packets


@EACH
def test_telemetry_values_match_the_client(interface: Interface) -> None:
    packets = parse(cosmos(interface))
    for message in messages(interface, MessageKind.TELEMETRY):
        items = packets["TELEMETRY", message.name.upper()]
        assert len(items) == len(message.fields)
        for data, values in frames(message, 20):
            for one in message.fields:
                item = items[one.name.upper()]
                assert same(one, item.value(data), values[one.name]), (message.name, one.name)
                if one.choices is not None:
                    states = {int(value): name for name, value in item.modifiers["STATE"]}
                    assert states[values[one.name]] == one.choices(values[one.name]).name


@EACH
def test_exported_commands_encode_the_values_the_node_decodes(interface: Interface) -> None:
    packets = parse(cosmos(interface))
    assert len(packets) == len(interface.messages) + len(messages(interface, MessageKind.TELEMETRY))
    for message in interface.messages:
        telemetry = message.kind is MessageKind.TELEMETRY
        items = packets["COMMAND", "REQUEST_" * telemetry + message.name.upper()]
        assert items["ID"].numbers == [str(message.id)] * 3
        assert items["ID"].value(bytes([message.id])) == message.id
        if telemetry:
            continue
        for data, values in frames(message, 5):
            for one in message.fields:
                item = items[one.name.upper()]
                raw = item.value(bytes([message.id]) + data)
                factors = item.modifiers.get("POLY_WRITE_CONVERSION", [["0", "1"]])
                assert [factor for _, factor in factors] == [f"{one.scale:g}"]
                ours = values[one.name]
                assert raw == (ours if isinstance(ours, bytes) else pytest.approx(ours * one.scale))
                if item.kind in ("INT", "UINT"):
                    low, high, default = map(float, item.numbers)
                    assert low <= default <= high
                    if one.also is None:
                        assert low >= one.raw_range[0] / one.scale - 1e-9
                        assert one.ends[0] is None or low == pytest.approx(one.low)
