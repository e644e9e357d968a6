import os
import re
import signal
import threading
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.formats.linux_i2c import socket_path
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.cli import emulate
from cubestack.host.cli.main import main
from cubestack.host.emulation.remote_controls import TOKEN, ControlClient
from cubestack.host.errors import PortOpenError
from cubestack.host.targets import open_target

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

SOON_S = 60.0
BUS = 213  # unused


class Serving:
    """Runs the command, calls a function once it serves, then closes its pipe.

    Attributes:
        said: printed lines.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.said = list[str]()
        self._serves = threading.Event()
        self._failure: BaseException | None = None
        for module in (emulate, emulate.device_options):
            monkeypatch.setattr(module, "say", self._say)

    def _say(self, text: str) -> None:
        self.said.append(text)
        if text.endswith("Ctrl-C ends it") and self._last in text:
            self._serves.set()

    def __call__(self, *words: object, last: str, beside: Callable[[], None]) -> int:
        """Returns the exit status; ``last`` is the device that is announced last."""
        self._last = last
        reading, writing = os.pipe()

        def act() -> None:
            try:
                assert self._serves.wait(SOON_S)
                beside()
            except BaseException as failure:
                self._failure = failure
            finally:
                os.close(writing)

        actor = threading.Thread(target=act)
        actor.start()
        try:
            code = main(["emulate", *map(str, words), "--lifeline", str(reading)])
        finally:
            self._serves.set()
            actor.join()
        if self._failure is not None:
            raise self._failure
        return code

    def ports(self, title: str) -> list[str]:
        (line,) = (line for line in self.said if line.startswith(f"{title} serves on "))
        return re.findall(r"(\S+) at \d+ baud", line)


@pytest.fixture
def serving(monkeypatch: pytest.MonkeyPatch) -> Iterator[Serving]:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield Serving(monkeypatch)
    for number, handler in handlers.items():
        signal.signal(number, handler)


def identification(port: str, name: str) -> dict[str, Any]:
    with closing(open_target(port, name)) as target:
        return dict(target.node.telemetry("Identification"))


def test_serves_a_pty_and_records_the_session(serving: Serving, tmp_path: Path) -> None:
    port, kept = tmp_path / "tty", tmp_path / "kept.rec"
    found = dict[str, Any]()

    def beside() -> None:
        assert port.is_symlink()
        found.update(identification(str(port), "cubestar"))

    words = ("cubestar", "--pty", port, "--pace", "fast", "--record", kept, "--seed", "7")
    assert serving(*words, "--baud", "115200", last="CubeStar", beside=beside) == 0
    assert found["NodeType"] == 5
    assert not port.is_symlink()
    assert f"CubeStar serves on {port} at 115200 baud; Ctrl-C ends it" in serving.said
    recording = load_recording(kept)
    assert recording.device == "cubestar"
    assert recording.bauds["uart"] == 115_200
    assert recording.sent("uart", "host")[0]


def test_several_devices_share_a_bus_and_have_their_own_ports(serving: Serving) -> None:
    found = list[int]()

    def beside() -> None:
        (star,), (sense, bench) = serving.ports("CubeStar"), serving.ports("CubeSense")
        assert len({star, sense, bench}) == 3
        for port, name in ((star, "cubestar"), (sense, "cubesense")):
            found.append(identification(port, name)["NodeType"])
        assert socket_path(BUS).exists()

    words = ("cubestar", "cubesense", "--tcp", "0", "--pace", "fast", "--i2c", BUS)
    assert serving(*words, last="CubeSense", beside=beside) == 0
    assert found == [5, 4]
    assert not socket_path(BUS).exists()
    assert f"I2C bus {BUS}: cubestack run --attach --bus {BUS} -- PROGRAM" in serving.said
    (line,) = (line for line in serving.said if line.startswith("CubeSense serves on "))
    assert re.search(r"^CubeSense serves on tcp://\S+ at 57600 baud, .*\w+ on tcp://\S+ at", line)


def test_prints_what_faults_do(serving: Serving, tmp_path: Path) -> None:
    plan, port = tmp_path / "plan.toml", tmp_path / "tty"
    plan.write_text("[[fault]]\nkind = 'latch-up'\ntarget = 'imager'\nat_s = 1e-4\n", "utf-8")

    def beside() -> None:
        identification(str(port), "cubestar")

    words = ("cubestar", "--pty", port, "--pace", "fast", "--faults", plan)
    assert serving(*words, last="CubeStar", beside=beside) == 0
    assert any("latch-up imager" in line for line in serving.said)


def test_control_needs_its_token(serving: Serving, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN, "a-secret")
    about = dict[str, Any]()

    def beside() -> None:
        (line,) = (line for line in serving.said if line.startswith("control on "))
        url, told = re.findall(r"control on (\S+), token (\S+)", line)[0]
        assert told == "a-secret"
        about["devices"] = ControlClient(url, told).ask("GET", "/")["devices"]
        about["no_past"] = ControlClient(url, told).ask("GET", "/devices/aramis")["no_past"]
        with pytest.raises(PortOpenError, match="requires its token"):
            ControlClient(url, "another").ask("GET", "/")

    words = ("aramis", "--tcp", "0", "--pace", "fast", "--control", "0")
    assert serving(*words, last="AraMiS", beside=beside) == 0
    assert about == {"devices": ["aramis"], "no_past": ""}


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
