"""The set-up of a recorded device: round trip, and errors."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.formats.recording import RecordingWriter, load_recording
from cubestack.firmware_model.formats.setup import Document, Setup

TEXTS = st.text(max_size=30)
DOCUMENTS = st.none() | st.builds(Document, TEXTS, TEXTS)
OPTIONS = st.dictionaries(TEXTS, st.booleans() | st.integers() | TEXTS, max_size=3)
SETUPS = st.builds(Setup, TEXTS, st.just(""), st.integers(0, 2**40), DOCUMENTS, DOCUMENTS, OPTIONS)


@given(SETUPS)
def test_what_is_written_is_read(tmp_path_factory, setup):
    stream = io.StringIO()
    RecordingWriter(stream, "cubestar", {"uart": 57_600}, setup)
    path = tmp_path_factory.getbasetemp() / "setup.rec"
    path.write_text(stream.getvalue(), encoding="utf-8")
    assert load_recording(path).setup == setup


def test_recording_of_a_real_device_has_no_setup():
    setup = Setup("1.0", target="/dev/ttyUSB0", seed=3)
    assert setup.to_json() == {"version": "1.0", "target": "/dev/ttyUSB0"}
    assert Setup.from_json(setup.to_json()) == Setup("1.0", target="/dev/ttyUSB0")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ([], '"setup" must be an object'),
        ({"sede": 1}, "no member 'sede'"),
        ({"seed": -1}, "whole number from 0, not -1"),
        ({"seed": True}, "whole number from 0, not True"),
        ({"scene": "sky.toml"}, '"scene" must be an object'),
        ({"faults": {"text": 1}}, '"text" must be a text, not 1'),
        ({"options": {"x": []}}, '"options" must be an object'),
    ],
)
def test_rejects_inconsistent_setups(content, reason):
    with pytest.raises(ValueError, match=reason):
        Setup.from_json(content)
