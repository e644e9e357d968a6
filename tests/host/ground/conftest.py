"""An emulation that is served, and steered by its control port; the page at all sensors."""

import http.client
import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.ports.control import ControlPort
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.host.devices.registry import device_names
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.emulation.history import History
from cubestack.host.ground.control_api import control_app
from cubestack.host.ground.emulation import Emulation
from cubestack.host.ground.guard import Guard
from cubestack.host.ground.serving import Serving
from cubestack.host.recording.setups import emulated_setup

from .browser import look, shown, station

TOKEN = "the token of the tests"
SOON_S = 30.0


@dataclass
class Controlled:
    """A control port that is served, and what is behind it."""

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
        """Status and answer of a request with the token; as JSON, unless ``as_text``."""
        text = body if isinstance(body, bytes) else None if body is None else json.dumps(body)
        own = {"Authorization": f"Bearer {TOKEN}"} if headers is None else headers
        connection = http.client.HTTPConnection(*self.serving.address, timeout=SOON_S)
        try:
            connection.request(method, path, text, own)
            answer = connection.getresponse()
            content = answer.read().decode()
            return answer.status, content if as_text else json.loads(content or "null")
        finally:
            connection.close()

    @property
    def emulated(self) -> AnyEmulated:
        """The device as it is now."""
        return self.devices[0]

    @property
    def events(self) -> str:
        """Address of the WebSocket."""
        return self.serving.url.replace("http:", "ws:") + "/events"


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
def address(chromium: Any) -> Iterator[str]:
    """Of a page with all sensors; for modules that are one xdist group, so that they start once."""
    targets = [f"emulated:{name}" for name in device_names()]
    with station(*targets, "--seed", "5") as opened:
        yield opened


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    """A tab that looks at a CubeStar."""
    with shown(chromium, address) as opened:
        look(opened, "CubeStar")
        yield opened
