import json
import shutil
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.errors import CommandRefusedError, NoAnswerError, TargetError
from cubestack.host.ground.playback import PlaybackClient, is_recording, open_recording
from cubestack.host.ground.relays import recording
from cubestack.host.ground.session import LinkState, TargetSession
from cubestack.host.targets import Target, open_target
from cubestack.host.transport.streams import SerialTransport

from ..conftest import FakeCubeStar, LetterLine, UartLink
from .cable import cable
from .conftest import SOON_S, listening, recorded_threshold, serving_pages
from .fast_server import Changing, Hurried


class Behind:
    """A session and the node of its line."""

    def __init__(self) -> None:
        self.node = FakeCubeStar()
        line = UartLink(self.node)
        self.session = TargetSession(Target("fake", INTERFACE, NodeClient(line, INTERFACE), line))


@pytest.fixture
def behind() -> Iterator[Behind]:
    one = Behind()
    yield one
    one.session.close()


def test_refused_telecommand_does_not_break_the_link(behind: Behind) -> None:
    behind.node.refusals.append(AckError.BAD_PARAMETER)
    with pytest.raises(CommandRefusedError, match="CaptureAndProcess refused: BAD_PARAMETER"):
        behind.session.execute("write CaptureAndProcess").result()
    assert behind.session.link == LinkState()


def test_silent_node_breaks_the_link_until_it_answers(behind: Behind) -> None:
    behind.node.lost = 100
    with pytest.raises(NoAnswerError):
        behind.session.execute("read TaskStatus").result()
    link = behind.session.link
    assert (link.failed, link.broken) == (1, True)
    behind.node.lost = 0
    behind.session.execute("read TaskStatus").result()
    assert (link.failed, link.broken) == (1, False)


@pytest.mark.parametrize("client", ["cubestar", None])
def test_missing_features_depend_on_the_device(client: str | None) -> None:
    line = UartLink(FakeCubeStar())
    known = None if client is None else device(client)
    session = TargetSession(
        Target("fake", INTERFACE, NodeClient(line, INTERFACE), line, device=known)
    )
    without = {"detections", "results", "download", "upload", "scene_form", "sensor_registers"}
    assert without & session.about["missing"].keys() == (set() if client else without)
    session.close()


class Held(Hurried):
    held = True

    def ask(self, method: str, path: str, body: object = None) -> dict[str, Any]:
        told = super().ask(method, path, body)
        return told | {"held": self.held} if path == "/state" else told


def test_device_is_not_read_while_time_is_held() -> None:
    port, uart = Held(), UartLink(Changing())
    target = Target("held", INTERFACE, NodeClient(uart, INTERFACE), device=device("cubestar"))
    target.controls = RemoteControls(port, "cubestar")  # type: ignore[arg-type]
    wanted = {"show": ["Identification"], "results": True, "every_s": 0.2}
    with (
        closing(TargetSession(target)) as session,
        serving_pages(session) as serving,
        listening(serving, "/targets/0/live") as socket,
    ):
        socket.send(json.dumps(wanted))
        held = [json.loads(socket.recv(SOON_S)) for _ in range(3)]
        assert all(one["emulation"]["held"] and one["link"]["sent"] == 0 for one in held)
        assert not any("values" in one or "results" in one for one in held)
        port.held = False
        while "values" not in (told := json.loads(socket.recv(SOON_S))):
            pass
        assert told["values"]["Identification"]["NodeType"] is not None
        assert told["results_logged"] == 1
        assert told["emulation"]["truth"]["ra_deg"] > 0


@pytest.mark.skipif(shutil.which("socat") is None, reason="no socat")
@pytest.mark.parametrize("reopens", [True, False])
def test_serial_line_recovers_from_an_unplugged_cable(
    tmp_path: Path, uart: Any, reopens: bool
) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    with cable(ours, theirs, uart):
        target = open_target(str(ours), "cubestar")
        assert isinstance(target.line, SerialTransport)
        target.line.reopens = reopens
        session = TargetSession(target)
        assert "error" not in session.read(["Identification"]).result(SOON_S)["Identification"]
    assert "error" in session.read(["Identification"]).result(SOON_S)["Identification"]
    assert "error" in session.read(["Identification"]).result(SOON_S)["Identification"]
    with cable(ours, theirs, uart):
        found = session.read(["Identification"]).result(SOON_S)["Identification"]
        assert ("error" in found) is not reopens
    assert session.link.failed >= 2
    session.close()


# --- a recording as the target --------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded_threshold(tmp_path_factory.mktemp("played") / "a.rec", 2.0)


def test_playback_returns_telemetry_of_the_played_time(made: Path) -> None:
    clock = [100.0]
    client = PlaybackClient(load_recording(made), CUBESENSE, lambda: clock[0])
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


def test_recording_opens_as_a_page_target(made: Path) -> None:
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
    session = TargetSession(Target("fake", CUBESENSE, NodeClient(LetterLine(), CUBESENSE)))
    with pytest.raises(ValueError, match="fake is not recorded: start with --record FILE"):
        recording(session)
    assert session.about["missing"]["recording"] == "fake is not recorded: start with --record FILE"
    session.close()
