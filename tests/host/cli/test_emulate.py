import re
from argparse import Namespace
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.formats.i2c_socket import socket_path
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.cli import emulate
from cubestack.host.emulation.process import emulating
from cubestack.host.emulation.remote_controls import TOKEN, ControlClient
from cubestack.host.errors import PortOpenError
from cubestack.host.targets import open_target
from tests.forked import Served

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

BUS = 213  # unused


@contextmanager
def serving(*words: object, last: str) -> Iterator[list[str]]:
    """Runs the command in a process.

    Yields the lines that it prints until device ``last`` serves, and adds the others at its end.
    """
    said = list[str]()
    with emulating([*map(str, words), "--pace", "fast"], {"COLUMNS": "500"}) as lines:
        for line in lines:
            said.append(line)
            if line.startswith(f"{last} serves on "):
                break
        yield said
    said += lines


def ports(said: list[str], title: str) -> list[str]:
    (line,) = (line for line in said if line.startswith(f"{title} serves on "))
    return re.findall(r"(\S+) at \d+ baud", line)


def node_type(port: object, name: str) -> Any:
    with closing(open_target(str(port), name)) as target:
        return target.node.telemetry("Identification")["NodeType"]


def test_serves_a_pty_and_records_the_session(tmp_path: Path) -> None:
    port, kept = tmp_path / "tty", tmp_path / "kept.rec"
    words = ("cubestar", "--pty", port, "--record", kept, "--seed", "7", "--baud", "115200")
    with serving(*words, last="CubeStar") as said:
        assert port.is_symlink()
        assert node_type(port, "cubestar") == 5
    assert not port.is_symlink()
    assert f"CubeStar serves on {port} at 115200 baud; Ctrl-C ends it" in said
    recording = load_recording(kept)
    assert recording.device == "cubestar"
    assert recording.bauds["uart"] == 115_200
    assert recording.sent("uart", "host")[0]


@pytest.mark.slow
def test_several_devices_share_a_bus_and_have_their_own_ports() -> None:
    with serving("cubestar", "cubesense", "--tcp", "0", "--i2c", BUS, last="CubeSense") as said:
        (star,), (sense, bench) = ports(said, "CubeStar"), ports(said, "CubeSense")
        assert len({star, sense, bench}) == 3
        assert [node_type(star, "cubestar"), node_type(sense, "cubesense")] == [5, 4]
        assert socket_path(BUS).exists()
    assert not socket_path(BUS).exists()
    assert f"I2C bus {BUS}: cubestack run --attach --bus {BUS} -- PROGRAM" in said
    (line,) = (line for line in said if line.startswith("CubeSense serves on "))
    assert re.search(r"^CubeSense serves on tcp://\S+ at 57600 baud, .*\w+ on tcp://\S+ at", line)


@contextmanager
def in_a_fork(*words: object, folder: Path, last: str) -> Iterator[list[str]]:
    """The same without the time that a process takes to start."""
    said = list[str]()
    with Served([*words, "--pace", "fast"], folder, last=f"{last} serves on ") as served:
        said += served.said.splitlines()
        yield said
    said[:] = served.said.splitlines()


def test_emulate_prints_fault_events(tmp_path: Path) -> None:
    plan, port = tmp_path / "plan.toml", tmp_path / "tty"
    plan.write_text("[[fault]]\nkind = 'latch-up'\ntarget = 'imager'\nat_s = 1e-4\n", "utf-8")
    words = ("cubestar", "--pty", port, "--faults", plan)
    with in_a_fork(*words, folder=tmp_path, last="CubeStar") as said:
        assert node_type(port, "cubestar") == 5
    assert any("latch-up imager" in line for line in said)


def test_control_needs_its_token(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(TOKEN, "a-secret")
    words = ("aramis", "--tcp", "0", "--control", "0")
    with in_a_fork(*words, folder=tmp_path, last="AraMiS") as said:
        (line,) = (line for line in said if line.startswith("control on "))
        url, told = re.findall(r"control on (\S+), token (\S+)", line)[0]
        assert told == "a-secret"
        assert ControlClient(url, told).ask("GET", "/")["devices"] == ["aramis"]
        assert ControlClient(url, told).ask("GET", "/devices/aramis")["no_past"] == ""
        with pytest.raises(PortOpenError, match="requires its token"):
            ControlClient(url, "another").ask("GET", "/")


@pytest.mark.parametrize(
    ("given", "past"),
    [
        ({"control": None}, "nothing is recorded"),
        ({"control": 1, "trace": "x"}, "--trace can't be undone"),
        ({"control": None, "gdb": 7, "orbit": "x"}, "--gdb can't be undone"),
        ({"control": 1, "profile_out": "x"}, "--profile-out can't be undone"),
        ({"control": 1, "coverage_out": "x"}, "--coverage-out can't be undone"),
        ({"control": 1, "orbit": "x"}, "--orbit can't be undone"),
    ],
)
@pytest.mark.parametrize("devices", [1, 2])
def test_explains_why_going_back_is_disabled(
    monkeypatch: pytest.MonkeyPatch, given: dict[str, Any], past: str, devices: int
) -> None:
    recorded = list[Any]()
    monkeypatch.setattr(emulate.device_options, "record", lambda *of: recorded.append(of[1]))
    nothing = dict.fromkeys(("control", *emulate.FORWARD_ONLY))
    opened: list[Any] = [object()] * devices
    args = Namespace(**nothing | given, record=None)
    assert emulate._history(args, opened, [None] * devices, ExitStack()) == past  # type: ignore[list-item]
    assert recorded == (opened if devices == 1 else [])
