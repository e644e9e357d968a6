"""A served emulation with its control port, and the page with all sensors."""

import http.client
import json
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from cubestack.emulator.ports.control import ControlPort
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.host.devices.registry import device_names
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.emulation.history import History
from cubestack.host.ground.control_api import control_app
from cubestack.host.ground.emulation import Emulation
from cubestack.host.ground.guard import Guard
from cubestack.host.ground.page_app import page_app
from cubestack.host.ground.serving import LOOPBACK, Serving
from cubestack.host.ground.session import TargetSession
from cubestack.host.recording.setups import emulated_setup
from cubestack.host.targets import open_target

from .browser import look, shown, station

TOKEN = "the token of the tests"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
SOON_S = 30.0


def request(
    serving: Serving,
    method: str,
    path: str,
    body: object = None,
    headers: dict[str, str] | None = None,
) -> tuple[http.client.HTTPResponse, bytes]:
    """The answer to a request, by default with the token, and its content."""
    text = body if isinstance(body, bytes) else None if body is None else json.dumps(body)
    with closing(http.client.HTTPConnection(*serving.address, timeout=SOON_S)) as connection:
        connection.request(method, path, text, BEARER if headers is None else headers)
        answer = connection.getresponse()
        return answer, answer.read()


def listening(
    serving: Serving, path: str, headers: dict[str, str] | None = None
) -> ClientConnection:
    """A WebSocket to ``path``, by default with the token."""
    address = serving.url.replace("http:", "ws:") + path
    told = BEARER if headers is None else headers
    # Where messages wait to be read, the answer to its end does, too, and does not come.
    return connect(address, additional_headers=told, open_timeout=SOON_S, close_timeout=1.0)


@contextmanager
def serving_pages(session: TargetSession) -> Iterator[Serving]:
    opened = Future[TargetSession]()
    opened.set_result(session)
    serving = Serving(Guard(page_app([opened]), TOKEN), LOOPBACK, 0)
    with serving.running():
        yield serving


def recorded_threshold(path: Path, after_s: float) -> Path:
    """Records a CubeSense: a threshold is read, set to 9 ``after_s`` later, and read again."""
    with closing(open_target("emulated:cubesense", record=path)) as target:
        target.node.telemetry("Configuration")
        target.node.pause(after_s)
        target.node.command("DetectionThreshold1", Threshold=9)
        target.node.telemetry("Configuration")
    return path


@dataclass
class Controlled:
    """A served control port with its emulation."""

    serving: Serving
    devices: list[AnyEmulated]
    emulation: Emulation
    scheduler: RealtimeScheduler

    def ask(
        self,
        method: str,
        path: str,
        body: object = None,
        headers: dict[str, str] | None = None,
        *,
        as_text: bool = False,
    ) -> tuple[int, Any]:
        """Status and answer of a request, as JSON unless ``as_text``."""
        answer, content = request(self.serving, method, path, body, headers)
        return answer.status, content.decode() if as_text else json.loads(content or b"null")

    @property
    def emulated(self) -> AnyEmulated:
        return self.devices[0]

    def act(self, *words: str) -> tuple[int, Any]:
        return self.ask("POST", "/devices/cubestar/act", {"words": words})

    def run(self, to_s: float) -> tuple[int, Any]:
        return self.ask("POST", "/run", {"to_s": to_s})

    def state(self) -> Any:
        return self.ask("GET", "/state")[1]


@pytest.fixture
def controlled(tmp_path: Path) -> Iterator[Controlled]:
    emulated = open_device("cubestar")
    devices = [emulated]
    past = History(devices, [emulated_setup(0, None)], [tmp_path / "a.rec"])
    kernel = emulated.board.kernel
    port = ControlPort(kernel)
    scheduler = RealtimeScheduler(
        kernel, [port], lambda: devices[0].board.busy(), Pace(kernel, "real")
    )
    port.scheduler = scheduler
    emulation = Emulation(port, devices, past=past)
    app = Guard(control_app(emulation), TOKEN)
    serving = Serving(app, "127.0.0.1", 0)
    thread = threading.Thread(target=scheduler.run)
    thread.start()
    with serving.running():
        yield Controlled(serving, devices, emulation, scheduler)
        scheduler.stop()
        thread.join(SOON_S)
        port.close()
    past.close()
    devices[0].close()


@pytest.fixture(scope="module")
def address(request: pytest.FixtureRequest, chromium: Any) -> Iterator[str]:
    """Address of a page with the ``DEVICES`` of a test module, by default with all sensors."""
    names = getattr(request.module, "DEVICES", device_names())
    with station(*(f"emulated:{name}" for name in names), "--seed", "5") as opened:
        with shown(chromium, opened):  # waits until all devices have started
            pass
        yield opened


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    with shown(chromium, address) as opened:
        look(opened, "CubeStar")
        yield opened
