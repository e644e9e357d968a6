"""Actions on a device that another process emulates, over its control port."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from cubestack.firmware_model.formats.setup import files_json
from cubestack.firmware_model.formats.untrusted import LARGEST_FILE, parse_json
from cubestack.firmware_model.versions import CONTROL
from cubestack.host.emulation.controls import spoken
from cubestack.host.errors import PortOpenError, TargetError, TransportError
from cubestack.host.recording.setups import read_document

TOKEN = "CUBESTACK_TOKEN"
"""Environment variable with the control port's token."""

HTTP_ERRORS = 400
"""HTTP statuses from here on are errors."""

TIMEOUT_S = 60.0
"""Time-out of a request in s."""

PATIENT = ("/run", "/back", "/trace")
"""Ends of paths that have no time-out."""


class ControlClient:
    """Client of a control port (docs/how-to/control.md)."""

    def __init__(self, url: str, token: str) -> None:
        """Send nothing yet; raises TargetError for an invalid address."""
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port
        except ValueError:
            host = port = None
        if not host or not port:
            raise TargetError(
                f"{url} is not the address of a control port; give one like http://127.0.0.1:8700"
            )
        self.url, self._address = f"http://{parts.netloc}", (host, port)
        self._headers = {"Authorization": f"Bearer {token}"}

    def ask(self, method: str, path: str, body: object = None) -> dict[str, Any]:
        """The answer.

        Raises ValueError if the request was rejected, TransportError if nobody answers.
        """
        told = parse_json(
            self.fetch(method, path, body), self.url, TransportError, largest=LARGEST_FILE
        )
        if not isinstance(told, dict):
            raise TransportError(f"{self.url}{path}: the answer is no object")
        return told

    def fetch(self, method: str, path: str, body: object = None) -> bytes:
        """The raw answer; raises as ``ask`` does."""
        import http.client  # it takes longer to load than this whole package

        patient = path.partition("?")[0].endswith(PATIENT)
        timeout_s = None if patient else TIMEOUT_S
        connection = http.client.HTTPConnection(*self._address, timeout=timeout_s)
        try:
            connection.request(
                method, path, None if body is None else json.dumps(body), self._headers
            )
            answer = connection.getresponse()
            content = answer.read(LARGEST_FILE)
            told = parse_json(content, "") if answer.status >= HTTP_ERRORS else {}
            error = told.get("error", "") if isinstance(told, dict) else "it failed"
        except ConnectionRefusedError:
            raise PortOpenError(f"no control port answers at {self.url}") from None
        except (OSError, http.client.HTTPException, ValueError) as failure:
            raise TransportError(f"{self.url}{path}: {failure or type(failure).__name__}") from None
        finally:
            connection.close()
        if answer.status == http.client.UNAUTHORIZED:
            raise PortOpenError(f"{self.url} requires its token in ${TOKEN}")
        if error:
            raise TargetError(str(error))
        return content


class RemoteControls:
    """``Controls`` of an emulation that keeps running at its own pace.

    Attributes:
        client: of the control port.
        device: name of the device.
        chosen: its seed, profile, switches and firmware, where they were given.
        no_past: why going back in time is not possible; empty if it is.
    """

    def __init__(self, client: ControlClient, device: str) -> None:
        self.client, self.device = client, device
        about = client.ask("GET", f"/devices/{device}")
        self.chosen = {"seed": str(about["seed"]), **about["chosen"]}
        self.no_past = str(about["no_past"])
        self.channels = tuple(about["channels"])
        self.faults = spoken({kind: one["targets"] for kind, one in about["faults"].items()})
        self.fault_parameters: Mapping[str, tuple[str, ...]] = {
            kind: tuple(one["parameters"]) for kind, one in about["faults"].items()
        }

    def fault(self, words: list[str]) -> None:
        self._act("fault", *words)

    def fault_log(self) -> list[str]:
        return list(self.client.ask("GET", f"/devices/{self.device}/log")["log"])

    def scene(self, path: Path) -> None:
        """See ``Controls``; the file is read here."""
        document = read_document(path)
        files = files_json(document.files)
        self._act("scene", document.name, text=document.text, **files)

    def point(self, words: list[str]) -> None:
        self._act("point", *words)

    def currents(self) -> dict[str, float]:
        return dict(self._state()["devices"][self.device]["currents_ma"])

    def switch(self, channel: str, on: bool) -> None:
        self._act("power", channel, "on" if on else "off")

    def peek(self, what: str) -> dict[str, tuple[int | None, str]]:
        """Not from here: ValueError."""
        raise TargetError(f"peek {what}: only where the device is emulated in this process")

    def time_s(self) -> float:
        return float(self._state()["time_s"])

    def advance(self, seconds: float) -> None:
        """See ``Controls``; a running emulation continues afterwards."""
        state = self._state()
        self.client.ask("POST", "/run", {"to_s": state["time_s"] + seconds})
        if not state["held"]:
            self.client.ask("POST", "/resume")

    def _state(self) -> dict[str, Any]:
        return self.client.ask("GET", "/state")

    def _act(self, *words: str, text: str = "", **files: Any) -> None:
        body = {"words": list(words), "text": text, **files}
        self.client.ask("POST", f"/devices/{self.device}/act", body)


def controlled(url: str, device: str | None = None) -> RemoteControls:
    """The controls of a device behind a control port; the token comes from the environment.

    Raises TargetError for another version of the protocol, and without ``device`` if there are
    several.
    """
    client = ControlClient(url, os.environ.get(TOKEN, ""))
    about = client.ask("GET", "/")
    try:
        CONTROL.check(about.get("version"))
    except ValueError as error:
        raise TargetError(f"{url}: {error}") from None
    known = about["devices"]
    if device is None and len(known) != 1:
        raise TargetError(f"{url} has {', '.join(known)}: give --device")
    return RemoteControls(client, device or known[0])
