"""The protocol class of a COSMOS plug-in: a Python module for the target's ``lib`` folder.

It is written to the interface of OpenC3's ``Protocol`` (openc3 7.4) and follows the rules of
``firmware_model.interface.codec.frames`` and ``host.export.answers``.
"""

from collections import Counter

from cubestack.firmware_model.interface.codec.frames import END, ESCAPE, START
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Interface
from cubestack.host.export.answers import ACKNOWLEDGE_ID, requested

_MODULE = '''\
"""Frames of {name}'s serial line for OpenC3 COSMOS. Generated; interface version {version}.

A frame is 1F 7F, the payload, 1F FF; a payload byte 1F is sent twice. An answer does not say what
it answers, so one request is sent at a time, and this protocol puts the ID of the request before
the answer: the telemetry's ID, or {acknowledge} and the telecommand's ID before an error byte.
"""

import threading

from openc3.interfaces.protocols.protocol import Protocol
from openc3.utilities.logger import Logger

ESCAPE, START, END = 0x{escape:02X}, 0x{start:02X}, 0x{end:02X}
TELEMETRY, ACKNOWLEDGE = 0x{telemetry:02X}, {acknowledge}

#: Bytes of an answer, by the telemetry's ID.
LENGTHS = {lengths}

#: Telemetry that alone has its length. Streams send it without requests.
ONLY = {only}

LONGEST = max(LENGTHS.values())


class {class_name}(Protocol):
    """PROTOCOL READ_WRITE {module}.py [seconds to wait for an answer]"""

    def __init__(self, answer_timeout=1.0, allow_empty_data=None):
        self.answer_timeout = float(answer_timeout)
        self.answered = threading.Event()
        super().__init__(allow_empty_data)

    def reset(self):
        super().reset()
        self.unread = b""
        self.payload = None  # of an open frame
        self.escaped = False  # the last byte was an escape
        self.request = None  # ID that waits for its answer
        self.answered.set()

    def write_data(self, data, extra=None):
        """The frame of a command, which begins with its ID."""
        escape = bytes([ESCAPE])
        payload = bytes(data)
        self.answered.clear()
        self.request = payload[0] if payload else None
        framed = payload.replace(escape, escape + escape)
        return bytes([ESCAPE, START]) + framed + bytes([ESCAPE, END]), extra

    def post_write_interface(self, packet, data, extra=None):
        """Wait for the answer, so that the next request does not take it."""
        if not self.answered.wait(self.answer_timeout):
            Logger.error(f"{class_name}: no answer to ID {{self.request}}")
            self.request = None
        return packet, data, extra

    def read_data(self, data, extra=None):
        """The next answer with its ID; STOP where bytes are missing."""
        self.unread += data
        for index, byte in enumerate(self.unread):
            payload = self.feed(byte)
            packet = None if payload is None else self.identified(payload)
            if packet is not None:
                self.unread = self.unread[index + 1 :]
                return packet, extra
        self.unread = b""
        return ("STOP", extra) if data else super().read_data(data, extra)

    def feed(self, byte):
        """The payload of the frame that this byte ends, else None. A broken frame is dropped."""
        escaped = self.escaped
        self.escaped = not escaped and byte == ESCAPE
        if self.escaped:
            return None
        if not escaped or byte == ESCAPE:
            if self.payload is None:
                self.escaped = escaped  # the second of two escapes may begin a frame
            elif len(self.payload) <= LONGEST:
                self.payload.append(byte)
            return None
        payload, self.payload = self.payload, bytearray() if byte == START else None
        return payload if byte == END else None

    def identified(self, payload):
        """The answer with its ID; None for one that is neither requested nor of a stream."""
        request = self.request
        if request is not None:
            if request < TELEMETRY and len(payload) == 1:
                prefix = bytes([ACKNOWLEDGE, request])
            elif len(payload) == LENGTHS.get(request):
                prefix = bytes([request])
            else:
                request = None
        if request is not None:
            self.request = None
            self.answered.set()
            return prefix + payload
        if len(payload) in ONLY:
            return bytes([ONLY[len(payload)]]) + payload
        Logger.error(f"{class_name}: unexpected answer of {{len(payload)}} bytes")
        return None
'''


def module_name(interface: Interface) -> str:
    return f"{interface.name.lower()}_protocol"


def protocol_module(interface: Interface) -> str:
    """Text of the module called ``module_name``.

    Its class has the name that COSMOS derives from that: words between underscores, capitalised.
    """
    lengths = {message.id: message.length for message in requested(interface)}
    count = Counter(lengths.values())
    # One byte may be an acknowledge that came too late.
    only = {size: number for number, size in lengths.items() if count[size] == 1 and size > 1}
    return _MODULE.format(
        name=interface.name,
        version=interface.version,
        module=module_name(interface),
        class_name="".join(word.capitalize() for word in module_name(interface).split("_")),
        escape=ESCAPE,
        start=START,
        end=END,
        telemetry=TELEMETRY_BIT,
        acknowledge=ACKNOWLEDGE_ID,
        lengths=_rows(lengths),
        only=_rows(only),
    )


def _rows(table: dict[int, int]) -> str:
    entries = [f"{key}: {value}," for key, value in table.items()]
    rows = [" ".join(entries[at : at + 8]) for at in range(0, len(entries), 8)]
    return "\n".join(["{", *(f"    {row}" for row in rows), "}"])
