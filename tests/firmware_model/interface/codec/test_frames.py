import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame

LIMIT = 20
# Bytes that mean something are drawn often, or no property would meet them.
BYTES = st.one_of(st.sampled_from([0x1F, 0x7F, 0xFF]), st.integers(0, 255))
NOISE = st.lists(BYTES, max_size=60).map(bytes)
PAYLOAD = st.lists(BYTES, max_size=LIMIT).map(bytes)


def events(decoder: FrameDecoder, data: bytes) -> list[FrameEvent | bytes]:
    found: list[FrameEvent | bytes] = []
    for byte in data:
        event = decoder.feed(byte)
        if event is FrameEvent.FRAME:
            found.append(decoder.payload)
        elif event is not None:
            found.append(event)
    return found


def trailing_escapes(data: bytes) -> int:
    return len(data) - len(data.rstrip(b"\x1f"))


@pytest.mark.parametrize(
    ("payload", "frame"),
    [
        ("80", "1F7F 80 1FFF"),
        ("2D 1F 1F 1F 80 80", "1F7F 2D 1F1F 1F1F 1F1F 8080 1FFF"),
        ("", "1F7F 1FFF"),
    ],
)
def test_frames_match_the_published_examples(payload: str, frame: str) -> None:
    assert encode_frame(bytes.fromhex(payload)) == bytes.fromhex(frame)
    assert events(FrameDecoder(LIMIT), bytes.fromhex(frame)) == [bytes.fromhex(payload)]


@given(st.lists(PAYLOAD))
def test_any_payloads_round_trip(payloads: list[bytes]) -> None:
    stream = b"".join(map(encode_frame, payloads))
    assert events(FrameDecoder(LIMIT), stream) == payloads


@given(NOISE, PAYLOAD)
def test_noise_before_a_frame_loses_it_only_after_an_open_escape(
    noise: bytes, payload: bytes
) -> None:
    found = events(FrameDecoder(LIMIT), noise + encode_frame(payload))
    swallowed = b"\x1f\x7f" in noise and trailing_escapes(noise) % 2 == 1
    if not swallowed:
        assert found[-1] == payload


@given(NOISE, PAYLOAD, PAYLOAD)
def test_second_frame_after_any_noise_is_decoded(noise: bytes, one: bytes, two: bytes) -> None:
    found = events(FrameDecoder(LIMIT), noise + encode_frame(one) + encode_frame(two))
    assert found[-1] == two


@given(NOISE, PAYLOAD)
def test_after_a_silence_the_next_frame_is_found(noise: bytes, payload: bytes) -> None:
    decoder = FrameDecoder(LIMIT)
    events(decoder, noise)
    decoder.reset()
    assert events(decoder, encode_frame(payload)) == [payload]


@given(NOISE)
def test_payloads_stay_within_the_limit(noise: bytes) -> None:
    for event in events(FrameDecoder(LIMIT), noise * 3):
        assert not isinstance(event, bytes) or len(event) <= LIMIT


def test_a_long_frame_is_reported_once_at_its_end() -> None:
    decoder = FrameDecoder(LIMIT)
    assert events(decoder, encode_frame(bytes(LIMIT + 50))) == [FrameEvent.TOO_LONG]
    assert events(decoder, encode_frame(bytes(LIMIT))) == [bytes(LIMIT)]
    assert events(decoder, encode_frame(bytes(LIMIT + 1))) == [FrameEvent.TOO_LONG]


@pytest.mark.parametrize(
    ("lost", "event"),
    [
        (b"\x1f\x7fabc", FrameEvent.INCOMPLETE),  # a start inside of a frame begins anew
        (b"\x1f\x7f\x80\x1f\x00", FrameEvent.PROTOCOL_ERROR),  # an unknown escape drops the frame
        *((b, FrameEvent.PROTOCOL_ERROR) for b in (b"\0", b"\x1f\0", b"\x1f\xff", b"\x1f")),
    ],
)
def test_what_is_lost_before_a_good_frame_is_one_error(lost: bytes, event: FrameEvent) -> None:
    assert events(FrameDecoder(LIMIT), lost + encode_frame(b"de")) == [event, b"de"]


@pytest.mark.parametrize(
    ("received", "unfinished"), [("", False), ("1F", True), ("1F7F80", True), ("1F7F801FFF", False)]
)
def test_silence_reports_unfinished_frame(received: str, unfinished: bool) -> None:
    decoder = FrameDecoder(LIMIT)
    events(decoder, bytes.fromhex(received))
    assert decoder.reset() is unfinished
    assert decoder.reset() is False


@given(NOISE, st.one_of(PAYLOAD.map(encode_frame), NOISE, st.just(encode_frame(bytes(LIMIT + 1)))))
def test_a_frame_taken_whole_leaves_what_its_bytes_would(noise: bytes, block: bytes) -> None:
    whole, by_bytes = FrameDecoder(LIMIT), FrameDecoder(LIMIT)
    events(whole, noise)
    events(by_bytes, noise)
    if whole.takes(block):
        assert events(by_bytes, block) == [whole.payload]
    else:
        events(whole, block), events(by_bytes, block)
    assert events(whole, noise) == events(by_bytes, noise)


@given(PAYLOAD)
def test_a_frame_is_taken_whole(payload: bytes) -> None:
    decoder = FrameDecoder(LIMIT)
    assert decoder.takes(encode_frame(payload))
    assert decoder.payload == payload
