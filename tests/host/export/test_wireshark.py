"""The dissector runs in Lua against a stub of the Wireshark API."""

import random
import struct
from typing import Any

import lupa
import pytest

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.host.export.wireshark import PORT, wireshark
from tests.host.export.frames import EACH, INTERFACES, frames, messages

HOST_PORT = 40000

WIRESHARK = """
base = { DEC = "dec", SPACE = "space" }
DESEGMENT_ONE_MORE_SEGMENT = "more"
Pref = { uint = function(name, value) return value end }

ProtoField = setmetatable({}, { __index = function(_, kind)
    return function(abbreviation, name, ...)
        return { kind = kind, abbreviation = abbreviation, name = name, more = { ... } }
    end
end })

function Proto(name, title)
    PROTO = { name = name, title = title, prefs = {} }
    return PROTO
end

DissectorTable = { get = function() return { add = function() end } end }

-- A Tvb and its ranges: bytes as a table, indexed from 0 by a call.
local Bytes = {}
Bytes.__index = Bytes
function make(bytes) return setmetatable({ bytes = bytes }, Bytes) end
Bytes.__call = function(self, offset, size)
    offset = offset or 0
    size = size or #self.bytes - offset
    assert(offset >= 0 and size >= 0 and offset + size <= #self.bytes, "out of range")
    local part = {}
    for i = 1, size do part[i] = self.bytes[offset + i] end
    return make(part)
end
function Bytes:len() return #self.bytes end
function Bytes:tvb() return self end
function Bytes:uint() assert(#self.bytes == 1); return self.bytes[1] end
function Bytes:le_uint()
    local value = 0
    for i = #self.bytes, 1, -1 do value = value * 256 + self.bytes[i] end
    return value
end
function Bytes:le_int()
    local value, ends = self:le_uint(), 256 ^ #self.bytes
    return value < ends / 2 and value or value - ends
end

ByteArray = { new = function(digits)
    local bytes = {}
    for pair in digits:gmatch("..") do bytes[#bytes + 1] = tonumber(pair, 16) end
    return make(bytes)
end }

local function branch(items)
    local tree = {}
    local function add(_, field, range, text)
        local item = { field = field, bytes = range and range.bytes, text = text }
        items[#items + 1] = item
        local own = branch(items)
        own.append_text = function(_, more) item.appended = more end
        return own
    end
    tree.add, tree.add_le = add, add
    return tree
end

function dissect(bytes, number, from, to)
    local items = {}
    local pinfo = { number = number, src_port = from, dst_port = to, cols = {} }
    PROTO.dissector(make(bytes), pinfo, branch(items))
    return items, pinfo
end
"""


class Dissector:
    def __init__(self, interface: Interface) -> None:
        self.lua = lupa.LuaRuntime()
        self.lua.execute(WIRESHARK)
        self.lua.execute(wireshark(interface))
        self.lua.globals().PROTO.init()
        self.number = 0

    def dissect(self, data: bytes, *, to_device: bool, number: int = 0) -> tuple[list[Any], Any]:
        """The tree that is added, and the packet's information."""
        self.number += 1
        ports = (HOST_PORT, PORT) if to_device else (PORT, HOST_PORT)
        call = self.lua.globals().dissect
        items, pinfo = call(self.lua.table_from(data), number or self.number, *ports)
        return list(items.values()), pinfo

    def fields(self, data: bytes, **options: Any) -> dict[str, Any]:
        items, _ = self.dissect(data, **options)
        return {
            item.field.abbreviation: item
            for item in items
            if item.field is not None and item.field.abbreviation is not None
        }


def shown(item: Any) -> Any:
    """A field's value as Wireshark reads it."""
    data, kind = bytes(item.bytes.values()), item.field.kind
    if kind == "bytes":
        return data
    if kind == "float":
        return struct.unpack("<f", data)[0]
    if kind == "bool":
        mask = item.field.more[3]
        return bool(data[0] & mask)
    return int.from_bytes(data, "little", signed=kind.startswith("int"))


@EACH
def test_message_values_match_the_client(interface: Interface) -> None:
    dissector, prefix = Dissector(interface), interface.name.lower()
    for message in interface.messages:
        telemetry = message.kind is MessageKind.TELEMETRY
        path = f"{prefix}.{'tlm' if telemetry else 'tc'}.{message.name.lower()}"
        for data, values in frames(message, 5):
            request = bytes([message.id]) + (b"" if telemetry else data)
            items = dissector.fields(encode_frame(request), to_device=True)
            if telemetry:
                assert items[f"{prefix}.request"].text == message.name
                items = dissector.fields(encode_frame(data), to_device=False)
            assert items[f"{prefix}.message"].text == message.name
            for field in message.fields:
                item = items[f"{path}.{field.name.lower()}"]
                value = shown(item)
                if field.scale == 1:
                    assert value == values[field.name]
                else:
                    assert value / field.scale == pytest.approx(values[field.name])
                    text = float(item.appended.strip(" ()").split(" ")[0].rstrip(")"))
                    assert text == pytest.approx(values[field.name], rel=1e-6)


def test_dissector_names_acknowledge_codes_and_wrong_lengths() -> None:
    interface = INTERFACES[0]
    dissector, prefix = Dissector(interface), interface.name.lower()
    ack = dissector.fields(encode_frame(b"\3"), to_device=False)[f"{prefix}.ack"]
    assert (shown(ack), ack.field.more[2][3]) == (3, interface.ack_errors(3).name)
    first = messages(interface, MessageKind.TELEMETRY)[0]
    dissector.dissect(encode_frame(bytes([first.id])), to_device=True)
    items = dissector.fields(encode_frame(bytes(first.length + 1)), to_device=False)
    assert items[f"{prefix}.wrong"].text == f"{first.length + 1} bytes, not {first.length}"


def test_dissector_second_pass_keeps_the_request_of_an_answer() -> None:
    interface = INTERFACES[0]
    dissector, prefix = Dissector(interface), interface.name.lower()
    first, second = messages(interface, MessageKind.TELEMETRY)[:2]
    answer = encode_frame(bytes(first.length))
    dissector.dissect(encode_frame(bytes([first.id])), to_device=True)
    name = f"{prefix}.message"
    assert dissector.fields(answer, to_device=False, number=100)[name].text == first.name
    dissector.dissect(encode_frame(bytes([second.id])), to_device=True)
    assert dissector.fields(answer, to_device=False, number=100)[name].text == first.name


def test_reassembles_split_and_joined_frames() -> None:
    interface = INTERFACES[0]
    dissector = Dissector(interface)
    request = encode_frame(bytes([messages(interface, MessageKind.TELEMETRY)[0].id]))
    for cut in range(1, len(request)):
        items, pinfo = dissector.dissect(request[:cut], to_device=True)
        assert (items, pinfo.desegment_offset, pinfo.desegment_len) == ([], 0, "more")
    items, pinfo = dissector.dissect(b"noise" + request + request, to_device=True)
    assert pinfo.desegment_len is None
    names = [item.field.abbreviation for item in items]
    assert names.count(f"{interface.name.lower()}.request") == 2


def test_random_bytes_raise_no_error() -> None:
    dissector, rng = Dissector(INTERFACES[0]), random.Random(0)
    for _ in range(500):
        data = bytes(rng.choice([0x1F, 0x7F, 0xFF, 0x83, 0]) for _ in range(rng.randrange(20)))
        dissector.dissect(data, to_device=rng.random() < 0.5)
