"""`cubestack replay`: recordings made and played by the options of the commands."""

import argparse
import json
from contextlib import ExitStack

import pytest

from cubestack.emulator.rtl.build import find_compiler
from cubestack.firmware_model.cubesense.state import CameraSettings
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.host.cli.boards import open_board
from cubestack.host.cli.main import main
from cubestack.host.cli.records import record
from cubestack.host.node_client import NodeClient

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def recording(tmp_path):
    """Some telemetry of a CubeSense."""
    path = tmp_path / "a.rec"
    args = argparse.Namespace(record=path, trace=tmp_path / "a.vcd")
    with ExitStack() as stack:
        opened = open_board("cubesense", None, seed=3, engine="auto", baud=None)
        stack.callback(opened.board.close)
        record(args, opened, stack)
        from cubestack.emulator.ports.direct import DirectSerial

        client = NodeClient(DirectSerial(opened.board.kernel, opened.lines[0].uart), INTERFACE)
        client.telemetry("Configuration")
        client.command("DetectionThreshold1", Threshold=9)
        client.telemetry("Configuration")
    assert (tmp_path / "a.vcd").stat().st_size > 1000
    return path


def test_no_difference(recording, capsys, tmp_path):
    again = tmp_path / "b.rec"
    assert main(["replay", str(recording), "--seed", "3", "--record", str(again)]) == 0
    assert "no difference" in capsys.readouterr().out
    assert again.read_text() == recording.read_text()


def test_changed_default_is_named(recording, capsys, monkeypatch):
    reset = CameraSettings.at_reset

    def changed(camera):
        settings = reset(camera)
        settings.threshold += 1
        return settings

    monkeypatch.setattr(CameraSettings, "at_reset", changed)
    assert main(["replay", str(recording), "--seed", "3", "--json"]) == 1
    (difference,) = json.loads(capsys.readouterr().out)["differences"]
    assert "telemetry Configuration, field Threshold1: 0xe2, recorded 0xe1" in difference


@pytest.mark.parametrize(
    ("content", "code", "error"),
    [
        ("nonsense", 2, "is no recording of version 1: line 1"),
        ('{"recording":1,"device":"mars","lines":{}}', 2, "no device 'mars'"),
        ('{"recording":1,"device":"cubestar","lines":{"bench_uart":1}}', 2, "has port bench_uart"),
    ],
)
def test_file_that_can_not_be_replayed(tmp_path, capsys, content, code, error):
    path = tmp_path / "x.rec"
    path.write_text(content)
    assert main(["replay", str(path)]) == code
    output = capsys.readouterr().err
    assert error in output
    assert output.count("\n") == 1


def test_file_that_is_not_there(capsys):
    assert main(["replay", "no.rec"]) == 1
    assert "no.rec" in capsys.readouterr().err


def test_trace_that_can_not_be_written(recording, capsys):
    assert main(["replay", str(recording), "--trace", "no/folder/x.vcd"]) == 2
    assert "can not write no/folder/x.vcd" in capsys.readouterr().err
