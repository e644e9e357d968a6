"""An emulation that is served, and steered by its control port."""

import http.client
import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from cubestack.emulator.ports.control import ControlPort
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.host.devices.emulated import AnyEmulated, open_device
from cubestack.host.ground.control_api import control_app
from cubestack.host.ground.emulation import Emulation
from cubestack.host.ground.guard import Guard
from cubestack.host.ground.serving import Serving

TOKEN = "the token of the tests"
SOON_S = 30.0


@dataclass
class Controlled:
    """A control port that is served, and what is behind it."""

    serving: Serving
    emulated: AnyEmulated
    scheduler: RealtimeScheduler

    def ask(
        self, method: str, path: str, body: object = None, headers: dict[str, str] | None = None
    ) -> tuple[int, Any]:
        """Status and answer of a request with the token."""
        text = body if isinstance(body, bytes) else None if body is None else json.dumps(body)
        own = {"Authorization": f"Bearer {TOKEN}"} if headers is None else headers
        connection = http.client.HTTPConnection(*self.serving.address, timeout=SOON_S)
        try:
            connection.request(method, path, text, own)
            answer = connection.getresponse()
            return answer.status, json.loads(answer.read() or b"null")
        finally:
            connection.close()

    @property
    def events(self) -> str:
        """Address of the WebSocket."""
        return self.serving.url.replace("http:", "ws:") + "/events"


@pytest.fixture
def controlled() -> Iterator[Controlled]:
    emulated = open_device("cubestar")
    kernel = emulated.board.kernel
    port = ControlPort(kernel)
    scheduler = RealtimeScheduler(kernel, [port], emulated.board.busy, Pace(kernel, "real"))
    port.scheduler = scheduler
    app = Guard(control_app(Emulation(port, [emulated])), TOKEN)
    serving = Serving(app, "127.0.0.1", 0)
    thread = threading.Thread(target=scheduler.run)
    thread.start()
    with serving.running():
        yield Controlled(serving, emulated, scheduler)
        scheduler.stop()
        thread.join(SOON_S)
        port.close()
    emulated.close()
