"""A page server whose device changes at each request, to simulate hours in minutes.

Each request to its control port advances time by one second and adds a line to the fault log; every
`PICTURE_EVERY` seconds the picture changes.
"""

import sys
from collections import deque
from concurrent.futures import Future
from itertools import count
from typing import Any

import numpy as np

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.ground import page_app
from cubestack.host.ground.guard import Guard
from cubestack.host.ground.serving import LOOPBACK, Serving
from cubestack.host.ground.session import TargetSession
from cubestack.host.pictures.images import png
from cubestack.host.targets import Target
from tests.host.conftest import FakeCubeStar, UartLink

PICTURE_EVERY = 10  # s
MOST_LINES = 100  # of the log in one answer

TASKS = [int(one) for one in INTERFACE.telemetry("TaskStatus").fields[0].choices or ()]


class Hurried:
    """A control port whose time advances by one second per request."""

    def __init__(self) -> None:
        self._seconds = count(1)
        self._second = 0
        self._picture = np.random.default_rng(8).random((512, 1024)) > 0.999

    def ask(self, _method: str, path: str, _body: object = None) -> dict[str, Any]:
        if path == "/state":
            return self._state()
        if path.endswith("/pictures"):
            number = self._second // PICTURE_EVERY
            return {
                "pictures": {
                    "SRAM": {"rows": 512, "columns": 1024, "changed_s": number, "stored": True}
                }
            }
        if "/log" in path:
            since = int(path.rpartition("=")[2] or 0)
            until = max(since, self._second)
            lines = [f"{second} s something happened" for second in range(since, until)]
            return {"log": lines[-MOST_LINES:], "count": until}
        return {"seed": 1, "chosen": {}, "no_past": "", "channels": [], "faults": {}}

    def fetch(self, _method: str, _path: str, _body: object = None) -> bytes:
        return png(np.roll(self._picture, self._second, axis=1).astype(np.uint8) * 200)

    def _state(self) -> dict[str, Any]:
        seconds = self._second = next(self._seconds)
        truth = {"ra_deg": seconds % 360.0, "dec_deg": 0.0, "roll_deg": 0.0}
        one = {"busy": False, "currents_ma": {"imager": seconds % 50}, "probes": {"resets": 0}}
        shared = {"time_s": float(seconds), "held": False, "pace": "real", "speed": 1.0}
        states = {"cubestar": one | {"truth": truth, "faults_logged": seconds}}
        return shared | {"snapshots": {}, "goes_back": False, "devices": states}


class Changing(FakeCubeStar):
    def __init__(self) -> None:
        super().__init__()
        self._number = count()

    def telemetry(self, name: str) -> dict[str, Any]:
        number = next(self._number)
        if name == "TaskStatus":
            return {"taskStatus": TASKS[number % len(TASKS)]}
        if name == "AttitudeQuaternion":
            angle = np.radians(number % 360) / 2
            return {"Q2": float(np.sin(angle)), "Q3": float(np.cos(angle)), "Valid": 1}
        return super().telemetry(name)


def main() -> None:
    """Prints the address of the page and serves until standard input ends."""
    page_app.EVERY_S = page_app.SHORTEST_S = 0.0  # type: ignore[misc]
    hurried = Hurried()
    node = Changing()
    line = UartLink(node)
    line.silences = deque(maxlen=10)  # type: ignore[assignment]
    node.log = deque(maxlen=10)  # type: ignore[assignment]
    target = Target("hurried", INTERFACE, NodeClient(line, INTERFACE), device=device("cubestar"))
    target.controls = RemoteControls(hurried, "cubestar")  # type: ignore[arg-type]
    opened = Future[TargetSession]()
    opened.set_result(TargetSession(target))
    serving = Serving(Guard(page_app.page_app([opened]), "token"), LOOPBACK, 0)
    with serving.running():
        print(f"{serving.url}/?token=token", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
