"""Oracle: a reader of COSMOS's documented grammar and bit order."""

import shlex
import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.field import f32, i16
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.firmware_model.interface.codec.node_messages import node_interface
from cubestack.host.export.answers import answers
from cubestack.host.export.cosmos.packets import _counts, cosmos, definitions
from tests.host.export.frames import EACH, frames, messages, same

MODIFIERS = {
    **{"STATE": (2, 3), "UNITS": (2,), "LIMITS": (7,)},
    **{"POLY_READ_CONVERSION": (2,), "POLY_WRITE_CONVERSION": (2,)},
    "SEG_POLY_WRITE_CONVERSION": (3,),
}


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
        elif keyword in ("ITEM", "ID_ITEM", "PARAMETER", "ID_PARAMETER"):
            name, bit, bits, kind, *numbers, _, endianness = rest
            parameter = 1 if kind == "BLOCK" else 3
            expected = {"ITEM": 0, "ID_ITEM": 1, "ID_PARAMETER": 3, "PARAMETER": parameter}
            assert len(numbers) == expected[keyword]
            assert kind in ("INT", "UINT", "FLOAT", "BLOCK")
            assert name not in items
            little = {"LITTLE_ENDIAN": True, "BIG_ENDIAN": False}[endianness]
            item = items[name] = Item(name, int(bit), int(bits), kind, little, numbers)
        elif keyword == "HAZARDOUS":
            assert len(rest) == 1
        else:
            assert len(rest) in MODIFIERS[keyword]
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
                assert factors == [["0.5" if one.scale != 1 else "0", f"{one.scale:g}"]]
                ours = values[one.name]
                assert raw == (ours if isinstance(ours, bytes) else pytest.approx(ours * one.scale))
                if item.kind in ("INT", "UINT"):
                    low, high, default = map(float, item.numbers)
                    assert low <= default <= high
                    if one.also is None:
                        assert low >= one.raw_range[0] / one.scale - 1e-9
                        assert one.ends[0] is None or low == pytest.approx(one.low)


@EACH
def test_risky_commands_are_hazardous(interface: Interface) -> None:
    lines = cosmos(interface).splitlines()
    marked = {
        lines[number - 1].split()[2]: shlex.split(line)[1]
        for number, line in enumerate(lines)
        if line.startswith("  HAZARDOUS ")
    }
    risks = {one.name.upper(): one.risk for one in interface.telecommands if one.risk}
    assert marked == risks
    assert risks


SIGNED = i16("Angle", "an angle", "deg", 100).within(-90, 90)
SHARE = f32("Share", "a share", reset=1.0).within(0.7, 1.1)


@pytest.fixture
def small() -> Packets:
    """Definitions of a node whose command has a signed scaled parameter."""
    interface = node_interface(
        "Small",
        i2c_address=0x30,
        telecommands=[Message(10, "Turn").of(SIGNED, SHARE)],
        telemetries=[Message(140, "Turned").of(SIGNED, SHARE)],
    )
    files = definitions(interface)
    return parse(files["cmd.txt"] + files["tlm.txt"])


@given(value=st.floats(-327, 327))
def test_counts_are_rounded_as_by_our_codec(value: float) -> None:
    """COSMOS takes the polynomial of the segment and drops what is behind the point."""
    conversions = [line.split() for line in _counts(SIGNED)]
    bounds = {float(words[1]): [float(one) for one in words[2:]] for words in conversions}
    offset, factor = bounds[max(one for one in bounds if one <= value or one == min(bounds))]
    assert int(offset + factor * value) & 0xFFFF == SIGNED.encode(value, saturate=False)


def test_limits_are_red_where_the_table_forbids_a_value(small: Packets) -> None:
    """COSMOS takes a value that equals a limit for outside."""
    for one in (SIGNED, SHARE):
        item = small["TELEMETRY", "TURNED"][one.name.upper()]
        ((*_, least, _, _, largest),) = item.modifiers["LIMITS"]
        for end, limit, outward in ((one.low, least, -1), (one.high, largest, 1)):
            if one is SHARE:
                last = float(np.float32(end))
                next_one = float(np.nextafter(np.float32(end), np.float32(outward * np.inf)))
            else:
                last, next_one = end, end + outward / one.scale
            assert (last - float(limit)) * outward < 0 <= (next_one - float(limit)) * outward


def test_range_has_the_limits_that_a_float32_carries(small: Packets) -> None:
    least, largest, _ = small["COMMAND", "TURN"]["SHARE"].numbers
    assert float(least) == min(0.7, float(np.float32(0.7))) < 0.7
    assert float(largest) == float(np.float32(1.1)) > 1.1


@EACH
def test_answers_have_an_id_of_their_own(interface: Interface) -> None:
    files = definitions(interface)
    packets = parse(files["tlm.txt"])
    ids = [items["PACKET_ID"].numbers for items in packets.values()]
    assert ids == [[str(message.id)] for message in answers(interface)]
    for message in answers(interface):
        items = packets["TELEMETRY", message.name.upper()]
        for data, values in frames(message, 5):
            for one in message.fields:
                theirs = items[one.name.upper()].value(bytes([message.id]) + data)
                assert same(one, theirs, values[one.name]), (message.name, one.name)
    commands = parse(files["cmd.txt"])
    assert all(items["PACKET_ID"].bit == 0 for items in commands.values())
    assert {name for _, name in commands} == {
        *(message.name.upper() for message in interface.telecommands),
        *(
            f"REQUEST_{message.name.upper()}"
            for message in interface.telemetries
            if message.supported
        ),
    }
