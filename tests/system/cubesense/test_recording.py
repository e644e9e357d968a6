import io
from contextlib import closing

import pytest

from cubestack.emulator.recording.recorder import Recorder
from cubestack.emulator.recording.replay import Replay
from cubestack.emulator.recording.trace import VcdTrace
from cubestack.firmware_model.formats.recording import Recording, load_recording
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.clients.cubesense.download import ServicePortClient
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.recording.playback import RecordedI2c, RecordedTransport

from .conftest import FACING


@pytest.fixture
def recorded(session, tmp_path) -> Recording:
    """A measurement, a picture over the bench, telemetry and registers over I2C."""
    path = tmp_path / "a.rec"
    with (
        session(FACING, seed=1) as opened,
        path.open("w") as stream,
        closing(Recorder(stream, "cubesense", opened.board.uarts)) as recorder,
    ):
        board = opened.board
        recorder.listen(board.i2c_bus)
        opened.client.capture_and_detect(Camera.SUN)
        opened.client.client.telemetry("Configuration")
        ServicePortClient(board.serial("bench_uart")).take(Camera.NADIR)
        bus = board.i2c()
        I2cClient(bus, INTERFACE, wait=bus.wait).telemetry("Power")
        RegisterClient(bus, INTERFACE.registers, wait=bus.wait).read("SUN_THRESHOLD")
    return load_recording(path)


def test_replay_gives_the_same_answers(recorded, session):
    with session(FACING, seed=1) as opened:
        board = opened.board
        assert Replay(recorded, board.kernel, board.uarts, board.i2c_bus).run(INTERFACE) == []


def test_clients_run_against_a_recording(recorded):
    cubesense = CubeSense(NodeClient(RecordedTransport(recorded, INTERFACE), INTERFACE))
    assert cubesense.capture_and_detect(Camera.SUN).detected
    ServicePortClient(RecordedTransport(recorded, INTERFACE, "bench_uart")).take(Camera.NADIR)
    power = I2cClient(RecordedI2c(recorded, INTERFACE), INTERFACE).telemetry("Power")
    assert 0 < power["Current5V"] < 200


def test_recording_does_not_change_the_run(recorded, session, tmp_path):
    path = tmp_path / "b.rec"
    with session(FACING, seed=1) as opened:
        trace = VcdTrace(io.StringIO(), "x", opened.board.kernel, opened.board.uarts)
        with path.open("w") as file, closing(Recorder(file, "cubesense", opened.board.uarts)):
            opened.client.capture_and_detect(Camera.SUN)
        trace.close()
    times = load_recording(path).sent("uart", "device")[1]
    assert recorded.sent("uart", "device")[1][: len(times)] == times
