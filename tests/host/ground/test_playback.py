from pathlib import Path

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import NoAnswerError, TargetError
from cubestack.host.ground.playback import PlaybackClient, is_recording, open_recording
from cubestack.host.ground.relays import recording
from cubestack.host.ground.session import TargetSession
from cubestack.host.targets import Target

from ..conftest import LetterLine
from .conftest import recorded_threshold


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded_threshold(tmp_path_factory.mktemp("played") / "a.rec", 2.0)


def test_telemetry_is_that_of_the_played_time(made: Path) -> None:
    clock = [100.0]
    client = PlaybackClient(load_recording(made), INTERFACE, lambda: clock[0])
    with pytest.raises(NoAnswerError, match=r"before 0\.000 s"):
        client.telemetry("Configuration")
    clock[0] += 1.0
    assert client.telemetry("Configuration")["Threshold1"] == 225
    clock[0] += 100.0
    assert client.time_s == client.end_s < 10.0
    assert client.telemetry("Configuration")["Threshold1"] == 9
    client.play(1.5, runs=False)
    clock[0] += 100.0
    assert client.time_s == 1.5
    assert client.telemetry("Configuration")["Threshold1"] == 225
    client.play(None, runs=True)
    clock[0] += 0.25
    assert client.time_s == 1.75
    for nonsense in (-1.0, 1e9, float("nan")):
        with pytest.raises(ValueError, match="a position must be 0 to"):
            client.play(nonsense, runs=True)


def test_recording_is_a_target_of_the_page(made: Path) -> None:
    assert is_recording(str(made))
    assert not is_recording("/dev/ttyUSB0")
    session = TargetSession(open_recording(str(made)))
    assert {"send", "controls", "raw", "download"} <= session.about["missing"].keys()
    assert "recording" not in session.about["missing"]
    assert session.playback is not None
    session.playback.play(session.playback.end_s, runs=False)
    values = session.read(["Configuration", "Result1"]).result()
    assert values["Configuration"]["Threshold1"] == 9
    assert "Result1 was not read" in values["Result1"]["error"]
    with pytest.raises(TargetError, match="accepts no telecommands"):
        session.execute("write DetectionThreshold1 7").result()
    with pytest.raises(ValueError, match="is a recording"):
        session.start_transfer("download")
    session.close()


def test_unrecorded_target_explains_how_to_record() -> None:
    session = TargetSession(Target("fake", INTERFACE, NodeClient(LetterLine(), INTERFACE)))
    with pytest.raises(ValueError, match="fake is not recorded: start with --record FILE"):
        recording(session)
    assert session.about["missing"]["recording"] == "fake is not recorded: start with --record FILE"
    session.close()
