"""Frames, layouts and records of the protocol, and the reference model of a board."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.devboard import (
    OPERATIONS,
    Code,
    Deviation,
    Frame,
    FrameDecoder,
    Identity,
    Layout,
    ProtocolError,
    decode_deviations,
    encode_deviation,
    encode_frame,
)
from cubestack.firmware_model.interface.devboard.frames import ESCAPE, FLAG
from cubestack.firmware_model.interface.devboard.outputs import apply_deviation
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop

FRAMES = st.builds(Frame, st.integers(0, 255), st.integers(0, 255), st.binary(max_size=300))


@given(st.lists(FRAMES, max_size=4), st.binary(max_size=20), st.integers(0, 40))
def test_frames_are_found_behind_garbage_and_in_pieces(
    frames: list[Frame], garbage: bytes, cut: int
) -> None:
    decoder = FrameDecoder()
    sent = garbage.replace(bytes([FLAG]), b"") + b"".join(map(encode_frame, frames))
    assert decoder.feed(sent[:cut]) + decoder.feed(sent[cut:]) == frames


@given(FRAMES, st.data())
def test_damaged_frame_is_dropped_and_the_next_one_found(frame: Frame, data: st.DataObject) -> None:
    sent = bytearray(encode_frame(frame))
    place = data.draw(st.integers(1, len(sent) - 2))
    sent[place] ^= data.draw(st.integers(1, 255))
    decoder = FrameDecoder()
    following = Frame(1, 2, b"next")
    assert decoder.feed(bytes(sent) + encode_frame(following))[-1:] == [following]
    assert decoder.damaged


@pytest.mark.parametrize("byte", [0, FLAG, ESCAPE, 0xFF])
def test_image_of_one_colour_costs_few_escapes(byte: int) -> None:
    assert len(encode_frame(Frame(0, Code.STORE, bytes([byte]) * 1024))) < 1024 * 1.03


@pytest.mark.parametrize("top", [CubeStarTop(), CubeSensePair()])
def test_no_pin_of_eight_bits_crosses_a_byte(top: CubeStarTop | CubeSensePair) -> None:
    for layout in (Layout.inputs(top.pins), Layout.outputs(top.pins)):
        number = 0
        for name, port in layout.ports.items():
            assert port.width > 8 or len(layout.bytes_of(name)) == 1
            number = layout.put(number, name, -1)
        ones = {name: (1 << port.width) - 1 for name, port in layout.ports.items()}
        assert layout.unpack(number) == ones
        assert number.bit_count() == sum(port.width for port in layout.ports.values())


@given(st.integers(0, 2**56 - 1), st.integers(0, 2**56 - 1), st.integers(0, 0xFFFF))
def test_deviation_restores_the_outputs(predicted: int, found: int, position: int) -> None:
    (deviation,) = decode_deviations(encode_deviation(position, predicted, found)) or [
        Deviation(position, {})
    ]
    assert deviation.position == position
    assert apply_deviation(predicted, deviation) == found


def test_request_with_a_value_too_large_is_rejected_by_name() -> None:
    with pytest.raises(ProtocolError, match="RUN: clocks is 0 to 65535, not 65536"):
        OPERATIONS[Code.RUN].request(camera=0, memory=0, line=0, pixel=0, clocks=1 << 16)


def test_identity_survives_the_line() -> None:
    identity = Identity(1, 4, 7, 7, 4096, 1300, 24_000_000, 3_000_000, b"12345678", "cubestar")
    assert Identity.parse(identity.pack()) == identity
    with pytest.raises(ProtocolError, match="version 9"):
        Identity.parse(b"\x09" + identity.pack()[1:])
