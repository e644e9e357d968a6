"""Packets of the remote protocol (GDB manual, appendix E), on a target without processor.

A session continues whatever a client sends.
"""

from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.iss.gdb.packets import LARGEST, Deframer, escape, framed, unescape
from cubestack.emulator.iss.gdb.session import MOST_BREAKPOINTS, MOST_OUTPUT, Session
from cubestack.emulator.iss.gdb.target import REGISTERS, SIGSEGV, Stop

from .fake_target import RAM, FakeTarget, Talk


def test_packet_is_framed_with_its_checksum() -> None:
    assert framed(b"OK") == b"$OK#9a"


@given(st.binary())
def test_gdb_escaping_round_trips(data: bytes) -> None:
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


@pytest.mark.parametrize(("checked", "found", "reply"), [(True, [], b"-"), (False, [b"g"], b"")])
def test_wrong_checksum_is_rejected_if_packets_are_acknowledged(
    checked: bool, found: list[bytes], reply: bytes
) -> None:
    deframer = Deframer(acknowledging=checked)
    assert list(deframer.feed(b"$g#00")) == found
    assert deframer.replies == reply


def test_byte_03_is_an_interrupt_only_between_packets() -> None:
    assert list(Deframer().feed(b"\x03" + framed(b"X0,1:\x03"))) == [None, b"X0,1:\x03"]


@pytest.mark.parametrize(
    "foreign",
    [
        b"POST / HTTP/1.1\r\n\r\n",
        b"\x16\x03\x01",  # TLS
        b"+P",
        b"$" + b"0" * (LARGEST + 8),
    ],
)
def test_client_that_speaks_another_protocol_is_disconnected(foreign: bytes) -> None:
    """What follows is not executed: a web page can send any body to any port."""
    target = FakeTarget()
    session = Session(target)
    session.receive(foreign + framed(b"M20000000,4:deadbeef"))
    session.receive(framed(b"M20000000,4:deadbeef"))
    assert session.ended
    assert session.output == b""
    assert target.memory[RAM][:4] == bytes(4)


def test_client_that_reads_no_answers_is_disconnected() -> None:
    session = Session(FakeTarget())
    for _ in range(2 * MOST_OUTPUT // LARGEST):
        session.receive(framed(b"m20000000,1000") * 10)
    assert session.ended
    assert len(session.output) < MOST_OUTPUT + 2 * LARGEST


def test_memory_of_a_client_is_bounded(talk: Talk) -> None:
    block = b"0" * (LARGEST - 40)
    answers = {talk.ask(b"vFlashWrite:%x:%b" % (at << 16, block)) for at in range(400)}
    assert answers == {b"OK", b"E01"}
    answers = {talk.ask(f"Z0,{2 * at:x},2") for at in range(MOST_BREAKPOINTS + 1)}
    assert answers == {b"OK", b"E01"}
    assert talk.ask("z0,0,2") == talk.ask("Z0,ffff0,2") == b"OK"


@pytest.fixture
def talk() -> Talk:
    return Talk()


def test_connecting_halts_the_target(talk: Talk) -> None:
    assert (talk.ask("?") or b"").startswith(b"T02thread:1;")


def test_gdb_server_announces_its_features(talk: Talk) -> None:
    features = (talk.ask("qSupported:multiprocess+;swbreak+;xmlRegisters=arm") or b"").split(b";")
    assert {b"QStartNoAckMode+", b"qXfer:features:read+", b"qXfer:memory-map:read+"} <= {*features}


def test_client_can_switch_acknowledgements_off(talk: Talk) -> None:
    assert talk.ask("QStartNoAckMode") == b"OK"
    talk.session.receive(framed(b"?"))
    assert talk.session.output.startswith(b"$")


def test_negative_acknowledge_repeats_the_answer(talk: Talk) -> None:
    talk.ask("p0")
    talk.send(b"-")
    assert talk.answer() == b"00000000"


def test_target_description_is_sent_in_parts(talk: Talk) -> None:
    text, more = b"", True
    while more:
        part = talk.ask(f"qXfer:features:read:target.xml:{len(text):x},40") or b""
        more, text = part[:1] == b"m", text + part[1:]
    registers = ElementTree.fromstring(text.split(b"?>", 1)[1].split(b">", 1)[1]).iter("reg")
    assert {int(r.attrib["regnum"]): r.attrib["name"] for r in registers} == REGISTERS


def test_memory_map_has_flash_blocks(talk: Talk) -> None:
    text = (talk.ask("qXfer:memory-map:read::0,1000") or b"")[1:]
    assert b'<memory type="flash" start="0x0" length="0x400">' in text
    assert b'<property name="blocksize">0x40</property>' in text
    assert b'<memory type="ram" start="0x20000000" length="0x400"/>' in text


def test_gdb_reads_and_writes_registers(talk: Talk) -> None:
    everything = talk.ask("g") or b""
    assert len(everything) == 8 * len(REGISTERS)
    assert everything[8 * 15 : 8 * 16] == b"0f000000"
    assert talk.ask("Pf=efbeadde") == b"OK"
    assert talk.ask("pf") == b"efbeadde"
    assert talk.ask(b"G" + everything) == b"OK"
    assert talk.target.values["pc"] == 15
    assert talk.ask("p1a") == b"1a000000"  # msp


def test_memory_is_read_and_written(talk: Talk) -> None:
    assert talk.ask(f"M{RAM:x},3:010203") == b"OK"
    assert talk.ask(b"X%x,4:" % (RAM + 3) + escape(b"#$}*")) == b"OK"
    assert talk.ask(f"m{RAM:x},8") == b"01020323247d2a00"
    assert talk.ask(f"X{RAM:x},0:") == b"OK"
    assert talk.ask("m30000000,4") == b"E01"
    assert talk.ask("M30000000,1:00") == b"E01"
    assert talk.ask(f"M{RAM:x},2:00") == b"E01"


def test_gdb_flash_writes_take_effect_at_flash_done(talk: Talk) -> None:
    talk.target.write(0, bytes(128))
    assert talk.ask("vFlashErase:40,40") == b"OK"
    assert talk.ask(b"vFlashWrite:50:" + escape(b"a:}c")) == b"OK"
    assert talk.target.read(0x50, 4) == b"\xff" * 4
    assert talk.ask("vFlashDone") == b"OK"
    assert talk.target.read(0x3F, 2) == b"\x00\xff"
    assert talk.target.read(0x50, 5) == b"a:}c\xff"


def test_continue_is_answered_when_the_target_stops(talk: Talk) -> None:
    assert talk.ask("vCont;c") is None
    assert talk.target.halted is None
    talk.target.halted = Stop(breakpoint=True)
    talk.session.look()
    assert (talk.answer() or b"").startswith(b"T05thread:1;hwbreak:;0d:0d000000;")


def test_interrupt_halts_the_target(talk: Talk) -> None:
    talk.ask("c")
    talk.send(b"\x03")
    assert (talk.answer() or b"").startswith(b"T02")


@pytest.mark.parametrize(
    ("packet", "low", "high"),
    [("s", 0, 0), ("vCont;s:1;c", 0, 0), ("vCont;r100,110:1", 0x100, 0x110), ("S05", 0, 0)],
)
def test_gdb_step_passes_its_address_range(talk: Talk, packet: str, low: int, high: int) -> None:
    assert (talk.ask(packet) or b"").startswith(b"T05")
    assert talk.target.calls == [("step", low, high)]


@pytest.mark.parametrize(
    ("stop", "text"),
    [(Stop(watch=("access", RAM + 4)), b"awatch:20000004;"), (Stop(SIGSEGV), b"T0b")],
)
def test_stop_reply_has_watchpoint_and_signal(talk: Talk, stop: Stop, text: bytes) -> None:
    talk.ask("c")
    talk.target.halted = stop
    talk.session.look()
    assert text in (talk.answer() or b"")


@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
def test_removing_one_of_two_breakpoints_at_an_address_keeps_the_other(
    talk: Talk, first: int, second: int
) -> None:
    for packet in (f"Z{first},100,2", f"Z{second},101,2", f"z{first},100,2"):
        assert talk.ask(packet) == b"OK"
    assert talk.target.calls[-1] == ("breakpoint", 0x100, True)
    assert talk.ask(f"z{second},100,2") == b"OK"
    assert talk.target.calls[-1] == ("breakpoint", 0x100, False)


def test_breakpoints_and_watchpoints_are_set_and_removed(talk: Talk) -> None:
    packets = ("Z0,101,2", "z0,100,2", "Z1,200,2", "Z2,20000000,4", "Z3,20000000,4", "z4,1,0")
    assert [talk.ask(packet) for packet in packets] == [b"OK"] * 6
    assert talk.target.calls == [
        ("breakpoint", 0x100, True),
        ("breakpoint", 0x100, False),
        ("breakpoint", 0x200, True),
        ("watchpoint", RAM, 4, "write", True),
        ("watchpoint", RAM, 4, "read", True),
        ("watchpoint", 1, 1, "access", False),
    ]
    assert talk.ask("Z7,0,0") == b""


@pytest.mark.parametrize(("command", "text"), [(b"time", b"0.5 s"), (b"x", b"no command 'x'")])
def test_monitor_answers_in_hex(talk: Talk, command: bytes, text: bytes) -> None:
    answer = talk.ask(b"qRcmd," + command.hex().encode()) or b""
    assert bytes.fromhex(answer.decode()) == text + b"\n"


@pytest.mark.parametrize("packet", ["D", "vKill;1"])
def test_target_runs_after_detach_and_kill(talk: Talk, packet: str) -> None:
    assert talk.ask(packet) == b"OK"
    assert talk.session.ended
    assert talk.target.calls == [("detach",)]
    assert talk.target.halted is None


def test_gdb_restarts_the_target(talk: Talk) -> None:
    assert talk.ask("!") == b"OK"
    assert talk.ask("R00") is None
    assert (talk.ask("vRun;") or b"").startswith(b"T05")
    assert talk.target.calls == [("restart",), ("restart",)]


@pytest.mark.parametrize("packet", ["qFoo", "vFoo", "Y", "QFoo", ""])
def test_unknown_packet_has_an_empty_answer(talk: Talk, packet: str) -> None:
    assert talk.ask(packet) == b""


@pytest.mark.parametrize("packet", ["p99", "mzz,1", "P0", "Z0", "Mx:", "vCont;r1", "qRcmd,x"])
def test_invalid_packet_is_answered_with_an_error(talk: Talk, packet: str) -> None:
    assert talk.ask(packet) == b"E01"


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


def test_extended_client_kills_and_runs_again_on_the_same_connection(talk: Talk) -> None:
    assert talk.ask("!") == b"OK"
    assert talk.ask("vKill;1") == b"OK"
    assert not talk.session.ended
    assert (talk.ask("vRun;") or b"").startswith(b"T")
