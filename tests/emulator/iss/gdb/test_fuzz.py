"""A session continues whatever a client sends."""

from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.iss.gdb.packets import framed

from .fake_target import Talk

HEADS = "?gGpPmMXcCsSzZvqQHTkDR!"
TAILS = st.text("0123456789abcdefF,;:=x.", max_size=24)
WORDS = st.sampled_from(
    ["", "Cont", "Cont;", "FlashErase:", "FlashWrite:", "FlashDone", "Xfer:features:read:",
     "Rcmd,", "Supported:", "Run", "Attach", "Kill"]
)  # fmt: skip


@given(st.lists(st.tuples(st.sampled_from(HEADS), WORDS, TAILS), max_size=12))
def test_session_answers_after_random_packets(packets: list[tuple[str, str, str]]) -> None:
    talk = Talk()
    for head, word, tail in packets:
        talk.send(framed(f"{head}{word}{tail}".encode()))
    if not talk.session.ended:
        talk.target.halt()
        talk.session.look()
        talk.session.output.clear()
        assert (talk.ask("?") or b"").startswith(b"T")


@given(st.binary(max_size=200))
def test_session_survives_random_bytes(data: bytes) -> None:
    talk = Talk()
    talk.send(data)
    talk.session.close()
    assert talk.target.halted is None
