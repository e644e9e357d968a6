"""The protocol class, on a stand-in for OpenC3's base class; test_openc3.py has the real one."""

import sys
import types
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.frames import (
    END,
    ESCAPE,
    START,
    FrameDecoder,
    FrameEvent,
    encode_frame,
)
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.export.answers import ACKNOWLEDGE_ID
from cubestack.host.export.cosmos.protocol import protocol_module
from tests.host.export.frames import EACH, INTERFACES

UNKNOWN = b"\x00" * 3
"""Of a length that several telemetry frames of CubeStar have."""


class Base:
    """What the documentation of COSMOS's custom protocols says of the base class."""

    def __init__(self, allow_empty_data: Any = None) -> None:
        self.reset()

    def reset(self) -> None:
        pass

    def read_data(self, data: bytes, extra: Any = None) -> tuple[Any, Any]:
        return (data if data else "STOP"), extra


class Log:
    errors: list[str] = []  # noqa: RUF012

    @classmethod
    def error(cls, text: str) -> None:
        cls.errors.append(text)


Make = Callable[..., Any]


@pytest.fixture(scope="module")
def make() -> Iterator[Make]:
    """Creates the protocol of an interface."""
    modules = {
        "openc3.interfaces.protocols.protocol": {"Protocol": Base},
        "openc3.utilities.logger": {"Logger": Log},
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, content in modules.items():
            module = types.ModuleType(name)
            vars(module).update(content)
            patch.setitem(sys.modules, name, module)

        def create(interface: Interface, *words: object) -> Any:
            space: dict[str, Any] = {}
            exec(compile(protocol_module(interface), "protocol.py", "exec"), space)
            return space[f"{interface.name.capitalize()}Protocol"](*words)

        yield create


def read(protocol: Any, line: bytes) -> list[bytes]:
    """The packets of these bytes, as an interface requests them."""
    found, data = [], line
    while True:
        packet, _ = protocol.read_data(data)
        if packet == "STOP":
            return found
        found.append(bytes(packet))
        data = b""


@EACH
def test_requests_are_framed_and_their_answers_get_an_id(interface: Interface, make: Make) -> None:
    protocol = make(interface)
    for message in interface.messages:
        if message.supported:
            data = bytes(range(0x10, 0x10 + message.length))
            wire, _ = protocol.write_data(bytes([message.id]))
            assert wire == encode_frame(bytes([message.id]))
            if message in interface.telemetries:
                assert read(protocol, encode_frame(data)) == [bytes([message.id]) + data]
            else:
                assert read(protocol, encode_frame(b"\x03")) == [
                    bytes([ACKNOWLEDGE_ID, message.id, 3])
                ]
            assert protocol.answered.is_set()


PIECE = st.one_of(
    st.binary(max_size=12),
    st.binary(max_size=12).map(encode_frame),
    st.lists(st.sampled_from([ESCAPE, START, END, 0]), max_size=6).map(bytes),
)


@given(pieces=st.lists(PIECE, max_size=6), cut=st.integers(0, 40))
def test_finds_the_frames_that_our_decoder_finds(make: Make, pieces: list[bytes], cut: int) -> None:
    """A line with noise, in two parts; each frame's payload is offered for identification."""
    protocol, line, offered = make(INTERFACES[0]), b"".join(pieces), list[bytes]()
    protocol.identified = lambda payload: offered.append(bytes(payload))
    assert read(protocol, line[:cut]) + read(protocol, line[cut:]) == []
    decoder = FrameDecoder(1000)
    events = [(decoder.feed(byte), decoder.payload) for byte in line]
    assert offered == [payload for event, payload in events if event is FrameEvent.FRAME]


def test_too_long_frames_take_no_memory_and_the_next_is_found(make: Make) -> None:
    protocol = make(INTERFACES[0])
    protocol.write_data(b"\x80")
    assert read(protocol, encode_frame(bytes(10_000))[:-2]) == []
    assert len(protocol.payload) < 1000
    assert read(protocol, bytes([ESCAPE, END]) + encode_frame(bytes(8))) == [b"\x80" + bytes(8)]


def test_streamed_frames_are_recognised_by_their_length(make: Make) -> None:
    """Also between a request and its answer; other unrequested frames are dropped."""
    protocol, block = make(INTERFACES[0]), bytes(128)
    protocol.write_data(b"\x80")
    line = encode_frame(block) + encode_frame(UNKNOWN) + encode_frame(bytes(8))
    assert read(protocol, line + encode_frame(b"\x00")) == [b"\x8f" + block, b"\x80" + bytes(8)]
    assert Log.errors[-2:] == [
        f"CubestarProtocol: unexpected answer of {count} bytes" for count in (3, 1)
    ]


def test_lost_answer_ends_the_wait(make: Make) -> None:
    """The next request then gets its own answer."""
    protocol = make(INTERFACES[0], "0.0")
    protocol.write_data(b"\x80")
    assert protocol.post_write_interface(1, 2, 3) == (1, 2, 3)
    assert Log.errors[-1] == "CubestarProtocol: no answer to ID 128"
    assert read(protocol, encode_frame(bytes(8))) == []
    protocol.write_data(b"\x81")
    assert read(protocol, encode_frame(bytes(11))) == [b"\x81" + bytes(11)]


def test_disconnection_ends_the_wait(make: Make) -> None:
    protocol = make(INTERFACES[0], "1e9")
    protocol.write_data(b"\x80")
    read(protocol, b"\x1f\x7f12")
    protocol.reset()
    protocol.post_write_interface(None, None)
    protocol.write_data(b"\x80")
    assert read(protocol, encode_frame(bytes(8))) == [b"\x80" + bytes(8)]
