"""Recordings as files: what is written is read; what is no recording says so in one line."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.formats import recording

TIMES = st.integers(0, 10**15)
LINES = st.builds(
    recording.LineBytes,
    TIMES,
    st.just("uart"),
    st.sampled_from(["host", "device"]),
    st.binary(min_size=1, max_size=9),
    st.integers(1, 10**9),
)
MESSAGES = st.builds(
    recording.BusMessage, st.integers(0, 127), st.binary(max_size=5), st.booleans()
)
TRANSFERS = st.builds(
    recording.BusTransfer,
    TIMES,
    st.just("i2c"),
    TIMES,
    st.lists(MESSAGES, max_size=3).map(tuple),
    st.integers(0, 130),
)
EVENTS = LINES | TRANSFERS | st.builds(recording.LineError, TIMES, st.just("uart"))


@given(st.lists(EVENTS, max_size=8))
def test_what_is_written_is_read(tmp_path_factory, events):
    stream = io.StringIO()
    writer = recording.RecordingWriter(stream, "cubestar", {"uart": 57_600})
    for event in events:
        writer.write(event)
    path = tmp_path_factory.getbasetemp() / "some.rec"
    path.write_text(stream.getvalue())
    found = recording.load_recording(path)
    assert (found.device, found.bauds) == ("cubestar", {"uart": 57_600})
    assert list(found.events) == sorted(events, key=lambda event: event.time_ps)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it is empty"),
        ("hello", "line 1: Expecting value"),
        ('{"recording": 2}', "line 1: there is no header"),
        ('{"recording": 1}', "line 1: lacks 'lines'"),
        ("[]", "line 1: there is no header"),
        ('{"recording": 1, "device": "x", "lines": {}}\n{"ps": 1}', "line 2: lacks 'port'"),
        (
            '{"recording": 1, "device": "x", "lines": {}}\n'
            '{"ps": 1, "port": "uart", "from": "me", "data": "", "byte_ps": 1}',
            'line 2: "from" must be',
        ),
        (
            '{"recording": 1, "device": "x", "lines": {}}\n'
            '{"ps": 1, "port": "uart", "from": "host", "data": "xy", "byte_ps": 1}',
            "line 2: non-hexadecimal",
        ),
        ("\x00\xff\n" * 3, "line 1: "),
    ],
)
def test_rejects_files_that_are_not_recordings(tmp_path, text, reason):
    path = tmp_path / "some.rec"
    path.write_text(text)
    with pytest.raises(recording.RecordingError, match=reason) as raised:
        recording.load_recording(path)
    assert "\n" not in str(raised.value)
    assert "some.rec" in str(raised.value)


def test_a_part_ends_with_what_begins_at_its_end():
    begun = [recording.LineError(time_ps, "uart") for time_ps in (5, 10, 11)]
    whole = recording.Recording("a", "cubestar", events=tuple(begun))
    assert [whole.until(end_ps).events for end_ps in (4, 10, 11)] == [
        (),
        tuple(begun[:2]),
        tuple(begun),
    ]
