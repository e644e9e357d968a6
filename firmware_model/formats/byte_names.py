"""Names for bytes in a recording: the message and field that a byte belongs to.

A device answers one request at a time, so its bytes belong to the last complete request before
them.
"""

from bisect import bisect_right

from cubestack.firmware_model.formats.recording import BusTransfer, Recording
from cubestack.firmware_model.interface.codec.frames import ESCAPE, FrameDecoder
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind

LONGEST_PAYLOAD = 4096


def name_answer_byte(interface: Interface, recording: Recording, port: str, index: int) -> str:
    """Name of byte ``index`` from the device, which may be the first one missing."""
    requests, request_times = recording.sent(port, "host")
    answers, answer_times = recording.sent(port, "device")
    if index < len(answers):
        known = requests[: bisect_right(request_times, answer_times[index])]
    else:
        known = requests
    place = f"{port}: byte {index} from the device"
    if interface.service_port is not None and port.startswith("bench"):
        letter = interface.service_port.find(known[-1]) if known else None
        return place if letter is None else f"{place}, answer to letter {letter.letter!r}"
    payload = _decode(known).payload
    if not payload:
        return f"{place}, before any request"
    message = interface.find(payload[0])
    if message is None:
        return f"{place}, answer to unknown ID {payload[0]}"
    offset = payload_offset(answers, index)
    if message.kind is MessageKind.TELECOMMAND:
        what = "error code" if offset == 0 else _framing(offset, 1)
        return f"{place}, acknowledge of telecommand {message.name}, {what}"
    return f"{place}, telemetry {message.name}, {_part(message, offset)}"


def name_request_byte(interface: Interface, written: bytes, index: int, port: str) -> str:
    """Name of byte ``index`` of all bytes that the host wrote on a serial line."""
    place = f"{port}: byte {index} from the host"
    if interface.service_port is not None and port.startswith("bench"):
        return place
    offset = payload_offset(written, index)
    if offset is None:
        return f"{place}, outside of a frame's payload"
    if offset == 0:
        return f"{place}, the ID"
    identifier = (_decode(written[:index]).open_payload or b"\0")[0]
    message = interface.find(identifier)
    if message is None:
        return f"{place}, behind unknown ID {identifier}"
    return f"{place}, {message.kind.value} {message.name}, {_part(message, offset - 1)}"


def name_bus_byte(interface: Interface, transfer: BusTransfer, message: int, index: int) -> str:
    found = transfer.messages[message]
    kind = "read" if found.read else "written"
    place = f"{transfer.port}: byte {index} {kind} at address {found.address:#04x}"
    pointer = next((m.data[0] for m in transfer.messages if not m.read and m.data), None)
    if pointer is None or (not found.read and index == 0):
        return place
    offset = index if found.read else index - 1
    registers = interface.registers
    if registers is not None and found.address == registers.i2c_address:
        register = registers.at(pointer)
        return place if register is None else f"{place}, register {register.name}"
    declared = interface.find(pointer)
    if declared is None:
        return f"{place}, unknown ID {pointer}"
    return f"{place}, {declared.kind.value} {declared.name}, {_part(declared, offset)}"


def payload_offset(wire: bytes, index: int) -> int | None:
    """Offset of wire byte ``index`` in its frame's payload; None outside of a payload.

    Both bytes of an escaped pair have the offset of the byte that they encode.
    """
    decoder = _decode(wire[:index])
    if decoder.open_payload is None:
        return None
    offset = len(decoder.open_payload)
    here, following = wire[index : index + 1], wire[index + 1 : index + 2]
    escape = bytes([ESCAPE])
    if decoder.escaped:
        return offset if here == escape else None
    if here == escape and following not in (b"", escape):
        return None
    return offset


def _decode(wire: bytes) -> FrameDecoder:
    decoder = FrameDecoder(LONGEST_PAYLOAD)
    for byte in wire:
        decoder.feed(byte)
    return decoder


def _part(message: Message, offset: int | None) -> str:
    if offset is None or not 0 <= offset < message.length:
        return _framing(offset, message.length)
    fields = [
        f.name
        for f in message.fields
        if f.bit_offset // 8 <= offset <= (f.bit_offset + f.bits - 1) // 8
    ]
    names = ", ".join(fields) if fields else "no field"
    return f"{'field' if len(fields) <= 1 else 'fields'} {names}"


def _framing(offset: int | None, length: int) -> str:
    return "framing" if offset is None else f"byte {offset} of {length}"
