from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.iss.gdb.packets import LARGEST, Deframer, escape, framed, unescape


def test_packet_is_framed_with_its_checksum() -> None:
    assert framed(b"OK") == b"$OK#9a"


@given(st.binary())
def test_escaped_data_are_unescaped_unchanged(data: bytes) -> None:
    escaped = escape(data)
    assert not set(escaped) & set(b"$#*")
    assert unescape(escaped) == data


@given(st.lists(st.binary(max_size=20)), st.integers(1, 30))
def test_packets_are_found_in_a_stream_cut_anywhere(bodies: list[bytes], step: int) -> None:
    stream = b"+".join(framed(escape(body)) for body in bodies)
    deframer = Deframer()
    found: list[bytes | None] = []
    for start in range(0, len(stream), step):
        found += deframer.feed(stream[start : start + step])
    assert [unescape(body) for body in found if body is not None] == bodies
    assert deframer.replies == b"+" * len(bodies)


def test_wrong_checksum_is_not_acknowledged() -> None:
    deframer = Deframer()
    assert list(deframer.feed(b"$g#00")) == []
    assert deframer.replies == b"-"


def test_checksum_is_ignored_without_acknowledgements() -> None:
    deframer = Deframer(acknowledging=False)
    assert list(deframer.feed(b"$g#00")) == [b"g"]
    assert deframer.replies == b""


def test_byte_03_is_an_interrupt_only_between_packets() -> None:
    assert list(Deframer().feed(b"\x03" + framed(b"X0,1:\x03"))) == [None, b"X0,1:\x03"]


def test_packet_without_end_is_dropped() -> None:
    deframer = Deframer()
    assert list(deframer.feed(b"$" + b"0" * (LARGEST + 8))) == []
    assert list(deframer.feed(framed(b"?"))) == [b"?"]
