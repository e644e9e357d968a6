"""The serial line: bytes at their times, a silence reported once; formats against a stepper."""

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.bus.line_format import LineFormat, LineSampler
from cubestack.emulator.sim.virtual_time import PS_PER_S

from .ends import Desk

BAUD = 10_000
BYTE = 1_000_000_000  # 10 bits
SILENCE = 5


@pytest.fixture
def desk() -> Desk:
    return Desk(BAUD, SILENCE)


@pytest.mark.parametrize(("baud", "byte_ps"), [(9600, 1_041_666_666), (57600, 173_611_111)])
def test_byte_takes_ten_bits(baud, byte_ps):
    desk = Desk(baud)
    assert desk.uart.byte_ps == byte_ps
    desk.uart.host_writes(b"a")
    desk.uart.send(b"b")
    desk.kernel.run()
    assert desk.received == [(byte_ps, ord("a"))]
    assert desk.delivered == [(byte_ps, ord("b"))]


@given(st.lists(st.tuples(st.integers(0, 8 * BYTE), st.binary(max_size=5)), max_size=8))
def test_blocks_queue_up_behind_each_other_in_both_directions(writes):
    """Oracle: a byte starts when it was written or when the line is free, whichever is later."""
    desk = Desk(BAUD, SILENCE)
    expected, free = [], 0
    for gap, data in writes:
        desk.kernel.advance_to(desk.kernel.now + gap)
        desk.uart.host_writes(data)
        desk.uart.send(data)
        for byte in data:
            free = max(free, desk.kernel.now) + BYTE
            expected.append((free, byte))
    desk.kernel.run()
    assert desk.received == expected
    assert desk.delivered == expected


def test_device_sends_while_it_receives(desk):
    desk.uart.on_byte = lambda byte: desk.uart.send(bytes([byte, byte]))
    desk.uart.host_writes(b"xy")
    desk.kernel.run()
    times = [time // BYTE for time, _ in desk.delivered]
    assert times == [2, 3, 4, 5]
    assert bytes(byte for _, byte in desk.delivered) == b"xxyy"


def test_reports_every_pause_once(desk):
    for _ in range(3):
        desk.uart.host_writes(b"a")
        desk.kernel.advance_to(desk.kernel.now + 20 * BYTE)
    assert desk.silences == [(20 * i + 1 + SILENCE) * BYTE for i in range(3)]


def test_short_pause_is_not_a_silence(desk):
    for _ in range(10):
        desk.uart.host_writes(b"a")
        desk.kernel.advance_to(desk.kernel.now + (1 + SILENCE) * BYTE - 1)
    assert desk.silences == []
    assert len(desk.received) == 10


def test_silence_that_means_nothing_to_the_program_is_no_event(desk):
    desk.uart.heeds_silence = lambda: desk.data.endswith(b"a")
    for data in (b"b", b"a", b"ab"):
        desk.uart.host_writes(data)
        desk.kernel.run()
    assert desk.silences == [(1 + 1 + SILENCE) * BYTE]
    assert desk.kernel.now == (1 + 1 + SILENCE + 2) * BYTE


def test_byte_written_at_the_end_of_a_silence_is_received(desk):
    desk.uart.host_writes(b"a")
    desk.kernel.advance_to((1 + SILENCE) * BYTE)
    desk.uart.host_writes(b"b")
    desk.kernel.run()
    assert desk.data == b"ab"
    assert desk.silences[-1] == desk.received[-1][0] + SILENCE * BYTE


def test_backlog_counts_the_byte_on_the_line(desk):
    assert (desk.uart.backlog, desk.uart.busy) == (0, False)
    desk.uart.send(b"abc")
    counts = []
    for time in (0, BYTE - 1, BYTE, BYTE + 1, 3 * BYTE - 1, 3 * BYTE):
        desk.kernel.advance_to(time)
        counts.append((desk.uart.backlog, desk.uart.busy))
    assert counts == [(3, True), (3, True), (2, True), (2, True), (1, True), (0, False)]
    desk.uart.host_writes(b"ab")
    for time, left in ((5 * BYTE - 1, 1), (5 * BYTE + 1, 0)):
        desk.kernel.advance_to(time)
        assert (desk.uart.host_backlog, desk.uart.busy) == (left, left > 0)


@pytest.mark.parametrize("said", [[], [b"only the device talks"]])
def test_silence_is_reported_only_after_received_bytes(desk, said):
    blocks = []
    desk.uart.line = lambda data, *_times: blocks.append(data)
    for data in (b"", *said):
        desk.uart.send(data)
    desk.uart.host_writes(b"")
    desk.kernel.advance_to(1000 * BYTE)
    assert (blocks, desk.silences) == (said, [])


FORMATS = st.builds(
    LineFormat,
    baud=st.sampled_from([300, 9600, 57_600, 115_200, 1_000_000]),
    data_bits=st.integers(5, 8),
    parity=st.sampled_from(list("NEOMS")),
    stop_bits=st.sampled_from([1, 1.5, 2]),
)


def heard(data: bytes, sender: LineFormat, receiver: LineFormat) -> list[tuple[int, bool, bool]]:
    sampler = LineSampler(receiver)
    for index, byte in enumerate(data):
        sampler.put(byte, index * sender.character_ps, sender)
    return [character[1:] for character in sampler.take(10**18)]


def stepped(data: bytes, sender: LineFormat, receiver: LineFormat) -> list[int]:
    """Oracle for 8N1: values with a good stop bit, found in steps of 1/16 of the faster bit."""
    step = Fraction(1, 16 * max(sender.baud, receiver.baud))
    bits = "".join(f"0{byte:08b}"[0] + f"{byte:08b}"[::-1] + "1" for byte in data)
    levels = [int(bit) for bit in bits] + [1] * (10 + 10 * sender.baud // receiver.baud)

    def level(time: Fraction) -> int:
        index = int(time * sender.baud)
        return levels[index] if index < len(levels) else 1

    values, time, last = [], Fraction(0), 1
    while time < Fraction(len(levels), sender.baud):
        now = level(time)
        if last and not now:
            edge = time
            samples = [level(edge + Fraction(2 * k + 1, 2 * receiver.baud)) for k in range(10)]
            looked = 0 if samples[0] else 9
            if looked and samples[9]:
                values.append(sum(bit << k for k, bit in enumerate(samples[1:9])))
            time, now = edge + Fraction(2 * looked + 1, 2 * receiver.baud), samples[looked]
            time -= time % step
        last = now
        time += step
    return values


@given(st.binary(max_size=20), FORMATS)
def test_equal_line_formats_transfer_all_bytes(data, form):
    mask = (1 << form.data_bits) - 1
    assert heard(data, form, form) == [(byte & mask, False, False) for byte in data]


@given(st.binary(max_size=40), st.floats(-0.04, 0.04))
def test_small_rate_differences_are_tolerated(data, difference):
    near = LineFormat(round(57_600 * (1 + difference)))
    assert [value for value, *_ in heard(data, near, LineFormat(57_600))] == list(data)


@settings(deadline=None, max_examples=30)
@given(st.binary(max_size=12), st.sampled_from([3, 5, 7]), st.booleans())
def test_garbled_bytes_equal_those_of_a_sampling_receiver(data, ratio, faster):
    """Odd ratios: no sample falls on an edge."""
    ends = LineFormat(9600 * ratio), LineFormat(9600)
    sender, receiver = ends if faster else ends[::-1]
    found = [value for value, framing, _ in heard(data, sender, receiver) if not framing]
    assert found == stepped(data, sender, receiver)


def test_even_parity_reaches_a_receiver_without_parity_as_its_stop_bit():
    even = LineFormat(57_600, parity="E")
    found = heard(bytes([0x1F, 0x7F, 0x80, 0xFF]), even, LineFormat(57_600))
    assert [(value, bad) for value, bad, _ in found] == [
        (0x1F, False),
        (0x7F, False),
        (0x80, False),
        (0xFF, True),  # eight ones: the parity bit is 0
    ]


def test_stop_bit_is_a_parity_of_1():
    assert [heard(b, LineFormat(9600), LineFormat(9600, parity="E")) for b in (b"\1", b"\3")] == [
        [(1, False, False)],
        [(3, False, True)],
    ]


def test_receiver_recovers_after_noise():
    sampler, fast = LineSampler(LineFormat(300)), LineFormat(1_000_000)
    for index in range(10_000):
        start_ps = index * 3 * fast.character_ps
        sampler.put(0xFF, start_ps, fast)
        list(sampler.take(start_ps))
        assert len(sampler._edges) <= 2 * 120  # of half a bit at 300 baud


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        *(({"baud": n}, rf"a baud rate in 1\.\.12000000, not {n}") for n in (0, -1, 12_000_001)),
        ({"baud": 9600, "data_bits": 9}, "5 to 8 data bits, not 9"),
        ({"baud": 9600, "parity": "X"}, "parity is N, E, O, M or S, not 'X'"),
        ({"baud": 9600, "stop_bits": 3}, "1, 1.5 or 2 stop bits, not 3"),
    ],
)
def test_rejects_impossible_line_settings(settings, text):
    with pytest.raises(ValueError, match=text):
        LineFormat(**settings)


def desk_of(host: LineFormat) -> Desk:
    desk = Desk(57_600)
    desk.uart.host_form = host
    return desk


@given(st.binary(max_size=12), FORMATS, st.lists(st.integers(0, 10**9), max_size=4))
def test_device_receives_bytes_as_its_receiver_samples_them(data, form, pauses):
    """In one piece; and, when only a bit too slow, whatever the pauses of the writer."""
    desk = desk_of(form)
    desk.uart.host_writes(data)
    desk.kernel.run()
    found = heard(data, form, LineFormat(57_600))
    assert desk.data == bytes(value for value, bad, _ in found if not bad)
    assert desk.uart.framing_errors == sum(bad for _, bad, _ in found)
    assert not desk.uart.busy

    desk = desk_of(LineFormat(57_000))
    for byte, pause_ps in zip(data, pauses, strict=False):
        desk.uart.host_writes(bytes([byte]))
        desk.kernel.advance_to(desk.kernel.now + pause_ps)
    desk.kernel.run()
    assert desk.data == data[: len(pauses)]


def test_slow_host_occupies_the_line_at_its_own_rate():
    desk = desk_of(LineFormat(300))
    desk.uart.host_writes(bytes(10))
    desk.kernel.advance_to(PS_PER_S // 3)
    assert desk.uart.host_backlog == 0
    assert not desk.received
    assert desk.uart.framing_errors == 10
    desk.kernel.run()
    assert len(desk.silences) == 1


def test_break_is_a_framing_error():
    desk = desk_of(LineFormat(57_600))
    desk.uart.host_breaks()
    desk.kernel.run()
    assert (desk.uart.framing_errors, desk.received) == (1, [])


def test_unsent_bytes_can_be_purged():
    desk = desk_of(LineFormat(57_600))
    desk.uart.host_writes(b"abc")
    desk.kernel.advance_to(desk.uart.byte_ps // 2)
    desk.uart.host_drops()
    desk.kernel.run()
    assert desk.data == b"a"
