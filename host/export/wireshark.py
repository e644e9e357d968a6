"""A Wireshark dissector in Lua from an interface: its node protocol, as a TCP port carries it.

Answers carry no ID, so the dissector remembers the last request of each conversation.
"""

from collections.abc import Iterator
from enum import IntEnum

from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Interface, Message
from cubestack.host.export.field_text import field_details

PORT = 5000
"""Default port of the dissector's preference."""

TYPES = {"u8": "uint8", "enum8": "uint8", "u16": "uint16", "u32": "uint32"}
TYPES |= {"i16": "int16", "f32": "float"}

_TAIL = """
local ESCAPE, START, END = 0x1F, 0x7F, 0xFF

-- The next frame at or behind an offset: first byte, byte behind it, payload in hexadecimal digits.
-- Nothing but the first byte where it is not complete.
local function next_frame(buffer, offset)
    local at, first, inside, digits = offset, nil, false, {}
    while at < buffer:len() do
        local byte = buffer(at, 1):uint()
        if byte ~= ESCAPE then
            if inside then digits[#digits + 1] = string.format("%02x", byte) end
            at = at + 1
        elseif at + 1 == buffer:len() then
            return first or at
        else
            local what = buffer(at + 1, 1):uint()
            if what == START then
                first, inside, digits = at, true, {}
            elseif what == END and inside then
                return first, at + 2, table.concat(digits)
            elseif what == ESCAPE and inside then
                digits[#digits + 1] = "1f"
            else
                inside = false
            end
            at = at + 2
        end
    end
    if inside then return first end
end

local function show(message, data, tree)
    if data:len() ~= message.length then
        tree:add(FIELDS.wrong, data(), data:len() .. " bytes, not " .. message.length)
        return
    end
    for _, item in ipairs(message.items) do
        local part = tree:add_le(item.field, data(item.at, item.size))
        if item.scale then
            local range = data(item.at, item.size)
            local raw = item.signed and range:le_int() or range:le_uint()
            part:append_text(string.format(" (%.7g %s)", raw / item.scale, item.unit))
        end
    end
end

-- By packet number: the requested message, and the request of an answer.
local asked, answers

function proto.init()
    asked, answers = {}, {}
end

function proto.dissector(buffer, pinfo, tree)
    local to_device = pinfo.dst_port == proto.prefs.port
    local host = to_device and pinfo.src_port or pinfo.dst_port
    local offset, count = 0, 0
    pinfo.cols.protocol = proto.name
    while offset < buffer:len() do
        local first, behind, digits = next_frame(buffer, offset)
        if first == nil then return end
        if behind == nil then
            pinfo.desegment_offset = first
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            return
        end
        count = count + 1
        local branch = tree:add(proto, buffer(first, behind - first))
        if digits ~= "" then
            local payload = ByteArray.new(digits):tvb("payload")
            local id = payload(0, 1):uint()
            local key = pinfo.number .. "." .. count
            if to_device then
                asked[tostring(host)] = id
                branch:add(FIELDS.id, payload(0, 1))
                local message = MESSAGES[id]
                if message and id < TELEMETRY then
                    branch:add(FIELDS.message, payload(0, 1), message.name)
                    if payload:len() > 1 then
                        show(message, payload(1):tvb(), branch)
                    end
                elseif message then
                    branch:add(FIELDS.request, payload(0, 1), message.name)
                end
            else
                answers[key] = answers[key] or asked[tostring(host)]
                local message = MESSAGES[answers[key] or -1]
                if message and answers[key] >= TELEMETRY then
                    branch:add(FIELDS.message, payload(0), message.name)
                    show(message, payload, branch)
                else
                    branch:add(FIELDS.ack, payload(0, 1))
                end
            end
        end
        offset = behind
    end
end

DissectorTable.get("tcp.port"):add(proto.prefs.port, proto)
"""


def wireshark(interface: Interface) -> str:
    """The script's text; it goes into Wireshark's folder of personal Lua plugins."""
    prefix = interface.name.lower()
    title = f"{interface.name} node protocol"
    lines = [
        f"-- {title}, interface version {interface.version}. Generated.",
        "-- The port is a preference of the protocol; Decode As works too.",
        f'local proto = Proto("{prefix}_node", "{title}")',
        f'proto.prefs.port = Pref.uint("TCP port", {PORT}, "at which the device answers")',
        f"local TELEMETRY = {TELEMETRY_BIT}",
        "local FIELDS = {",
        f'    id = ProtoField.uint8("{prefix}.id", "ID"),',
        f'    message = ProtoField.string("{prefix}.message", "Message"),',
        f'    request = ProtoField.string("{prefix}.request", "Request for"),',
        f'    wrong = ProtoField.string("{prefix}.wrong", "Wrong length"),',
        f'    ack = ProtoField.uint8("{prefix}.ack", "Acknowledge", base.DEC, '
        f"{_names(interface.ack_errors)}),",
        "}",
        "local MESSAGES = {}",
    ]
    for message in interface.messages:
        lines += _message(prefix, message)
    lines += [
        "proto.fields = {}",
        "for _, field in pairs(FIELDS) do table.insert(proto.fields, field) end",
        "for _, message in pairs(MESSAGES) do",
        "    for _, item in ipairs(message.items) do table.insert(proto.fields, item.field) end",
        "end",
    ]
    return "\n".join(lines) + "\n" + _TAIL


def _message(prefix: str, message: Message) -> Iterator[str]:
    kind = "tlm" if message.id & TELEMETRY_BIT else "tc"
    yield (
        f"MESSAGES[{message.id}] = {{ name = {_quoted(message.name)}, length = {message.length}, "
        "items = {"
    )
    for field in message.fields:
        abbreviation = f"{prefix}.{kind}.{message.name}.{field.name}".lower()
        size, name = max(field.bits // 8, 1), _quoted(field.name)
        about = _quoted(field_details(field))
        if field.type == "bool1":
            mask = f"0x{1 << field.bit_offset % 8:02X}"
            made = f'ProtoField.bool("{abbreviation}", {name}, 8, nil, {mask}, {about})'
        elif field.type.startswith("bytes"):
            made = f'ProtoField.bytes("{abbreviation}", {name}, base.SPACE, {about})'
        elif field.type == "f32":
            made = f'ProtoField.float("{abbreviation}", {name}, {about})'
        else:
            values = "nil" if field.choices is None else _names(field.choices)
            of_type = TYPES[field.type]
            made = (
                f'ProtoField.{of_type}("{abbreviation}", {name}, base.DEC, {values}, nil, {about})'
            )
        scale = ""
        if field.scale != 1:
            signed = str(field.type == "i16").lower()
            scale = f", scale = {field.scale:g}, signed = {signed}, unit = {_quoted(field.unit)}"
        yield f"    {{ at = {field.bit_offset // 8}, size = {size}, field = {made}{scale} }},"
    yield "} }"


def _names(choices: type[IntEnum]) -> str:
    return "{" + ", ".join(f'[{int(one)}] = "{one.name}"' for one in choices) + "}"


def _quoted(text: str) -> str:
    plain = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'
