"""Operations, statuses and limits of the protocol with a development board.

Numbers of several bytes are little-endian and unsigned.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import ClassVar, NamedTuple, Self

from cubestack.firmware_model.versions import DEVELOPMENT_BOARD

#: Of the protocol; a board with another one is rejected.
VERSION = DEVELOPMENT_BOARD.current

#: Default rate of the serial line in baud; 8 data bits, no parity, 1 stop bit.
BAUD = 3_000_000

#: Bytes of requests that a board can hold, counted as :func:`~.frames.buffered` does.
BUFFER = 4096

#: Responses that a board keeps, and requests that may be without a response.
RESPONSES = 8
WINDOW = RESPONSES - 1

#: Bytes of a request after its code, and of a response after ``done``, at most.
LONGEST_REQUEST = 1300
LONGEST_RECORDS = 240

#: Edges or steps of one operation at most, as the position in a record has 16 bits.
MOST_EDGES = 0xFFFF

#: Bit of a request's code: not executed if the operation before it did not end with status OK.
CHAINED = 0x80

#: Ends a record of :mod:`~.outputs`, in place of the number of a byte.
END_OF_RECORD = 0xFF

#: Input bytes and output bytes of a design at most, so that two records fit into a response.
MOST_BYTES = 56


class ProtocolError(ValueError):
    """A frame, request or response that the protocol does not have; the text is one line."""


class Status(IntEnum):
    """How an operation ended; ``meaning`` completes "the board ..."."""

    def __new__(cls, value: int, meaning: str = "") -> Self:
        status = int.__new__(cls, value)
        status._value_ = value
        status.meaning = meaning
        return status

    meaning: str

    OK = 0, "executed all of it"
    ACKNOWLEDGE = 1, "stopped after the edge that changed an acknowledge"
    READS = 2, "stopped after the edge at which a memory began to read, because it has no byte"
    ADDRESS = 3, "stopped after the edge at which the memory's address was not the predicted one"
    CHECK = 4, "stopped before a step CHECK whose output differs"
    FULL = 5, "stopped after a whole clock or step, because its response has no room for another"
    SKIPPED = 6, "did not execute it, because an operation before it did not end with OK"
    REJECTED = 7, "has no such operation, camera or memory, or such a length or count"
    NAK = 8, "waits for the request with this number"
    CLOSED = 9, "waits for HELLO"


class Parameter(NamedTuple):
    """A number at the start of a request."""

    name: str
    size: int  #: in bytes
    meaning: str


class Code(IntEnum):
    """Codes of the operations, without the flag :data:`CHAINED`."""

    HELLO = 1
    OUTPUTS = 2
    STEPS = 3
    RUN = 4
    STORE = 5
    READ = 6


@dataclass(frozen=True)
class Operation:
    """A request: its number parameters, and bytes behind them."""

    code: Code
    meaning: str
    parameters: tuple[Parameter, ...] = ()
    #: data: meaning of the bytes after the parameters; empty if there are none
    data: str = ""
    #: records: meaning of the response's records
    records: str = "deviations from the predicted outputs"

    @property
    def size(self) -> int:
        """Bytes of the parameters."""
        return sum(parameter.size for parameter in self.parameters)

    def request(self, data: bytes = b"", **values: int) -> bytes:
        """Payload of a request; ProtocolError for a value that does not fit."""
        if {*values} != {parameter.name for parameter in self.parameters}:
            names = ", ".join(parameter.name for parameter in self.parameters) or "no parameter"
            raise ProtocolError(f"{self.code.name} has {names}, not {', '.join(values)}")
        payload = b""
        for name, size, _ in self.parameters:
            if values[name] not in range(1 << 8 * size):
                most = (1 << 8 * size) - 1
                raise ProtocolError(f"{self.code.name}: {name} is 0 to {most}, not {values[name]}")
            payload += values[name].to_bytes(size, "little")
        if len(payload) + len(data) > LONGEST_REQUEST or (data and not self.data):
            room = LONGEST_REQUEST - len(payload) if self.data else 0
            raise ProtocolError(f"{self.code.name} takes {room} bytes of data, not {len(data)}")
        return payload + data

    def parse(self, payload: bytes) -> tuple[dict[str, int], bytes]:
        """Values of the parameters, and the data; ProtocolError for a wrong length."""
        if len(payload) < self.size or (len(payload) > self.size and not self.data):
            raise ProtocolError(f"{self.code.name} has {self.size} bytes, not {len(payload)}")
        values, at = {}, 0
        for name, size, _ in self.parameters:
            values[name] = int.from_bytes(payload[at : at + size], "little")
            at += size
        return values, payload[at:]


_CAMERA = Parameter("camera", 1, "number of the camera whose clock runs")
_MEMORY = Parameter("memory", 1, "number of the memory whose address and data are predicted")

#: Each clock of RUN and STORE is: the camera's clock pin rises, outputs are taken; the clock pin
#: falls; the next sample is put on its data and line pins, outputs are taken. After each edge every
#: memory's data input follows its data output while that is driven, else it is 0. The clock pin
#: must be low before, and no memory may be reading. Both end with ACKNOWLEDGE after an edge that
#: changed an acknowledge, and with READS after an edge at which a memory reads (CE_N and OE_N low,
#: WE_N high); with ACKNOWLEDGE if both apply.
#:
#: Each clock of READ is: the data clock rises; the memory's data input is set to the next byte, if
#: the memory's address is the predicted one; outputs are taken; the clock falls, outputs are taken.
#: If the address is not the predicted one, the outputs are taken, nothing is put, and READ ends
#: with ADDRESS after this edge. The same check follows the falling edge.
OPERATIONS: Mapping[Code, Operation] = {
    operation.code: operation
    for operation in (
        Operation(
            Code.HELLO,
            "set all inputs to their initial levels, wait for the number after this one, "
            "forget earlier stops; identify",
            (Parameter("nonce", 4, "a number that the response repeats"),),
            records="nonce, identity, outputs",
        ),
        Operation(Code.OUTPUTS, "take the outputs", records="all outputs, packed"),
        Operation(
            Code.STEPS,
            "execute steps; the outputs are predicted to stay",
            data="pairs of bytes: step and number of the byte in it, value",
        ),
        Operation(
            Code.RUN,
            "run a camera's clock with the same sample at each clock",
            (
                _CAMERA,
                _MEMORY,
                Parameter("line", 1, "level of the line pin"),
                Parameter("pixel", 1, "level of the data pins"),
                Parameter("clocks", 2, "number of clocks, at most half of MOST_EDGES"),
            ),
        ),
        Operation(
            Code.STORE,
            "run a camera's clock once for each pixel, with the line pin high from the first "
            "falling edge on",
            (_CAMERA, _MEMORY),
            data="pixels; the n-th one is put at the n-th falling edge",
        ),
        Operation(
            Code.READ,
            "run the data clock once for each byte",
            (_MEMORY, Parameter("step", 2, "predicted increment of the memory's address")),
            data="bytes of the memory at the predicted addresses after each rising edge",
        ),
    )
}


class Step(IntEnum):
    """The two high bits of a step; the six low bits are the number of a byte.

    A byte that the design does not have is not set, and is 0 in a CHECK.
    """

    SET = 0x00  #: set the input byte, and those staged before, at once; the outputs are taken
    STAGE = 0x40  #: the input byte will change at the next SET; for pins of more than 8 bits
    CHECK = 0x80  #: end with CHECK unless the output byte has this value


#: The part of a step that is the number of a byte.
STEP_BYTE = 0x3F


class Response(NamedTuple):
    """A response's payload.

    ``done`` is the number of edges (RUN, STORE, READ) or steps (STEPS) executed; of NAK it is the
    number of the request that was out of order, or DAMAGED.
    """

    status: Status
    done: int
    records: bytes = b""

    def payload(self) -> bytes:
        return self.done.to_bytes(2, "little") + self.records

    @classmethod
    def parse(cls, code: int, payload: bytes) -> Self:
        """From a frame's code and payload; ProtocolError if it is no response."""
        if code not in Status._value2member_map_ or len(payload) < 2:
            raise ProtocolError(f"no response has code {code} and {len(payload)} bytes")
        return cls(Status(code), int.from_bytes(payload[:2], "little"), payload[2:])


#: ``done`` of a NAK after damaged bytes.
DAMAGED = 0x100


@dataclass(frozen=True)
class Identity:
    """What HELLO returns of a board, between the nonce and the outputs."""

    version: int  #: of the protocol
    inputs: int  #: input bytes
    outputs: int  #: output bytes
    window: int  #: requests that may be without a response
    buffer: int  #: bytes of requests that it can hold
    longest: int  #: bytes of a request after its code
    clock_hz: int  #: of the bridge
    baud: int
    design: bytes  #: the first 8 bytes of the design's hash, see ``hdl.flow.generate``
    name: str  #: of the top, at most 16 characters of ASCII

    _FORMAT: ClassVar[struct.Struct] = struct.Struct("<4B2H2I8s16s")
    SIZE: ClassVar[int] = _FORMAT.size

    def pack(self) -> bytes:
        values = [getattr(self, field.name) for field in fields(self)]
        return self._FORMAT.pack(*values[:-1], self.name.encode("ascii")[:16])

    @classmethod
    def parse(cls, data: bytes) -> Self:
        """ProtocolError for too few bytes, or another version of the protocol."""
        if len(data) < cls.SIZE:
            raise ProtocolError(f"an identity has {cls.SIZE} bytes, not {len(data)}")
        *numbers, design, name = cls._FORMAT.unpack_from(data)
        try:
            DEVELOPMENT_BOARD.check(numbers[0])
        except ValueError as error:
            raise ProtocolError(str(error)) from None
        named = dict(zip((field.name for field in fields(cls)), numbers, strict=False))
        return cls(**named, design=design, name=name.rstrip(b"\0").decode("ascii", "replace"))
