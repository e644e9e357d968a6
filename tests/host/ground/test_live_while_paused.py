import json
from contextlib import closing
from typing import Any

from websockets.sync.client import connect

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.ground.session import TargetSession
from cubestack.host.targets import Target

from ..conftest import UartLink
from .conftest import BEARER, SOON_S, serving_pages
from .fast_server import Changing, Hurried


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
    with closing(TargetSession(target)) as session, serving_pages(session) as serving:
        address = serving.url.replace("http:", "ws:") + "/targets/0/live"
        with connect(address, additional_headers=BEARER, open_timeout=SOON_S) as socket:
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
