"""A target of the page. All tabs share it, and one thread sends the requests to it."""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, TypeVar

from cubestack.firmware_model.interface.codec.message import Message
from cubestack.host.clients.contract import Columns, DeviceClient
from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.errors import CommandRefusedError, HostError
from cubestack.host.export.field_text import field_details, field_json, picked
from cubestack.host.export.parquet import missing as parquet_missing
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.emulators import Emulator, UploadedFile
from cubestack.host.ground.playback import PlaybackClient
from cubestack.host.ground.results import ResultLog
from cubestack.host.ground.scenes import magnitude
from cubestack.host.ground.tables import (
    pointer_row,
    read_sensor_register,
    sensor_rows,
    setting_rows,
)
from cubestack.host.ground.transfer import Transfer, grey_values
from cubestack.host.pictures.overlay import Overlay, star_overlay
from cubestack.host.shell.language import Shell
from cubestack.host.shell.names import Names, ShellError
from cubestack.host.targets import Target

T = TypeVar("T")

PAGE_COMMANDS = ("read", "write", "dump", "list", "bench", "raw", "fault", "power", "time", "help")
"""Shell commands that access no file of this machine and always end."""

LONGEST_LINE = 10_000


@dataclass
class LinkState:
    """Attributes:
    failed: number of requests that failed after all retries.
    broken: whether the last request failed.
    error: of the last failure.
    """

    failed: int = 0
    broken: bool = False
    error: str = ""


class TargetSession:
    """Attributes:
    target: the open target.
    link: state of the link to it.
    transfer: the latest image transfer; None before the first one.
    restarts: number of restarts of its emulation.
    summary: the latest result in words; empty before the first.
    log: results that were read.
    """

    def __init__(self, target: Target, emulator: Emulator | None = None) -> None:
        """``close`` closes ``target``, and ``emulator`` if it runs the target."""
        self.target, self.link, self._emulator = target, LinkState(), emulator
        self.transfer: Transfer | None = None
        self.restarts = 0
        self.summary = ""
        self._described: Columns | None = None
        self.log = ResultLog()
        self._shell = Shell(target)
        self._thread = ThreadPoolExecutor(1, "target")

    @cached_property
    def about(self) -> JsonObject:
        """Tables and options of the target; ``missing`` has the reason of each missing feature."""
        target, interface, controls = self.target, self.target.interface, self.controls
        device = target.device
        return {
            "name": target.name,
            "device": interface.name,
            "telemetries": [_message(one) for one in interface.telemetries],
            "telecommands": [_message(one) for one in interface.telecommands],
            "registers": [pointer_row(one) for one in Names(target).registers],
            "settings": setting_rows(device) if device else [],
            "sensor_registers": sensor_rows(device) if device else [],
            "faults": list(controls.faults) if controls else [],
            "fault_parameters": dict(controls.fault_parameters) if controls else {},
            "channels": list(controls.channels) if controls else [],
            "chosen": controls.chosen if controls else {},
            "options": self._emulator.rows(controls.chosen) if self._emulator and controls else [],
            "restarts": self.restarts,
            "sources": list(self._client.picture_sources) if self._client else [],
            "playback": self.playback.state if self.playback else None,
            "missing": self._missing(),
        }

    def _missing(self) -> dict[str, str]:
        target, device, controls = self.target, self.target.device, self.controls
        name = target.interface.name
        missing = {} if controls else {"controls": f"{target.name} has no control port"}
        if controls and controls.no_past:
            missing["history"] = missing["recording"] = f"no way back: {controls.no_past}"
        if controls is None and target.recorded is None:
            missing["recording"] = f"{target.name} is not recorded: start with --record FILE"
        if device is None or device.scene_form is None:
            missing["scene_form"] = f"{name} declares no scene keys"
        if target.line is None:
            missing["raw"] = f"{target.name} is not a serial line"
        if self._overlay is None:
            missing["detections"] = f"{name} does not report what it detected"
        for what, method, reason in (
            ("results", "latest", "has no results to log"),
            ("observe", "observe", "takes no images"),
            ("download", "picture", "sends no image"),
            ("upload", "upload", "has no image upload"),
        ):
            if not self._implements(method):
                missing[what] = f"{name} {reason}"
        if self.playback is not None:
            for what in ("send", "observe", "download", "upload", "detections", "sensor_registers"):
                missing[what] = f"{target.name} is a recording, which accepts no telecommands"
        if target.registers is None:
            missing["registers"] = f"no registers of {name} can be reached here"
        if device is None or device.image_sensor is None:
            none = f"{name} can not read single registers of its image sensor"
            missing["sensor_registers"] = none
        if self._emulator is None:
            missing["restart"] = f"this page did not start an emulation of {target.name}"
        if none := parquet_missing():
            missing["parquet"] = none
        if target.service_port is None:
            missing["bench"] = "no line with the bench protocol is open"
        return missing

    @property
    def health(self) -> JsonObject:
        """``LinkState``, and the counts of ``Exchanges``."""
        registers, counts = self.target.registers, self.target.node.exchanges
        return vars(self.link) | vars(counts if registers is None else counts + registers.exchanges)

    @property
    def controls(self) -> RemoteControls | None:
        controls = self.target.controls
        return controls if isinstance(controls, RemoteControls) else None

    @property
    def playback(self) -> PlaybackClient | None:
        return self.target.node if isinstance(self.target.node, PlaybackClient) else None

    def execute(self, line: str) -> "Future[JsonObject]":
        """Execute a line of the shell: ``rows`` of text, and ``data``.

        The future raises ShellError, InterfaceError, HostError.
        """
        return self._request(lambda: self._execute(line))

    def read(self, names: Iterable[str]) -> "Future[JsonObject]":
        """Telemetry by name: its values, or ``error``."""
        return self._thread.submit(lambda: {name: self._read(name) for name in names})

    def detections(self, memory: str) -> "Future[JsonObject]":
        """Objects that the device detected in the image in ``memory``.

        ``marks`` have column ``x`` and row ``y``, ``name`` (empty if not identified), and
        ``v_mag`` or None; ``lines`` are lists of column and row.
        """
        return self._request(lambda: self._detections(memory))

    def sensor_register(self, name: str) -> "Future[JsonObject]":
        """A register of its image sensor; see ``read_sensor_register``."""
        return self._request(lambda: self._sensor_register(name))

    def results(self) -> "Future[JsonObject]":
        """Its latest result by column name, or ``error``."""
        return self._thread.submit(self._results)

    def observe(self) -> "Future[JsonObject]":
        """Have it capture and process an image; ``rows`` have the result in words.

        Raises ValueError if it takes none or a transfer runs.
        """
        self._require("observe")
        self._require_no_transfer()
        return self._request(self._observe)

    def start_transfer(
        self, what: str, source: str | None = None, content: bytes = b""
    ) -> Transfer:
        """Start a "download" from the memory ``source``, or an "upload" of an image file.

        All other requests wait until it ends. Raises ValueError if it is not possible or another
        one runs.
        """
        client = self._client
        self._require(what)
        self._require_no_transfer()
        assert client is not None
        if source is not None and source not in client.picture_sources:
            raise ValueError(f"no memory {source!r}; known: {', '.join(client.picture_sources)}")
        if what == "download":
            self.transfer = Transfer(what, lambda progress: client.picture(source, progress))
        else:
            image = grey_values(content)
            self.transfer = Transfer(what, lambda progress: client.upload(image, progress))
        self._request(self.transfer.run)
        return self.transfer

    def restart(
        self, options: Mapping[str, Any], files: Mapping[str, UploadedFile]
    ) -> "Future[JsonObject]":
        """Start its emulation again by ``Emulator.restart``; ``rows`` are its options.

        Raises ValueError if it is not possible or a transfer runs.
        """
        self._require("restart")
        self._require_no_transfer()
        assert self._emulator is not None
        return self._thread.submit(self._restart, self._emulator, options, files)

    def close(self) -> None:
        if self.transfer is not None:
            self.transfer.cancel()
        self._thread.shutdown(cancel_futures=True)
        self.target.close()
        self.log.close()
        if self._emulator is not None:
            self._emulator.close()

    def _require(self, what: str) -> None:
        if what in self.about["missing"]:
            raise ValueError(self.about["missing"][what])

    def _require_no_transfer(self) -> None:
        if self.transfer is not None and self.transfer.runs:
            raise ValueError("an image transfer is in progress")

    def _restart(
        self, emulator: Emulator, options: Mapping[str, Any], files: Mapping[str, UploadedFile]
    ) -> JsonObject:
        before = self.target
        self.target, end = emulator.restart(before, options, files)
        self._shell, self.link, self.transfer = Shell(self.target), LinkState(), None
        self.summary, self._described = "", None
        self.restarts += 1  # before ``about`` is computed again
        for name in ("about", "_client"):
            vars(self).pop(name, None)
        before.close()
        end()
        return {"rows": list(self.about["chosen"].items())}

    @cached_property
    def _client(self) -> DeviceClient | None:
        device = self.target.device
        return None if device is None else device.client(self.target.node)

    def _implements(self, method: str) -> bool:
        own = getattr(type(self._client), method, None)
        return own is not None and own is not getattr(DeviceClient, method)

    @property
    def _overlay(self) -> Callable[[Any, str], Overlay] | None:
        own = None if self.target.device is None else self.target.device.overlay
        return own or (star_overlay if self._implements("stars") else None)

    def _detections(self, memory: str) -> JsonObject:
        if self._overlay is None:
            raise ValueError(self.about["missing"]["detections"])
        overlay = self._overlay(self._client, memory)
        return {
            "marks": [
                {
                    "x": one.x_px,
                    "y": one.y_px,
                    "name": one.name,
                    "v_mag": None if one.hipparcos is None else magnitude(one.hipparcos),
                }
                for one in overlay.marks
            ],
            "lines": [line.tolist() for line in overlay.lines],
        }

    def _sensor_register(self, name: str) -> JsonObject:
        if self.target.device is None:
            raise ValueError(self.about["missing"]["sensor_registers"])
        return read_sensor_register(self.target.device, self.target.node, name)

    def _observe(self) -> JsonObject:
        assert self._client is not None
        self._shell.asked(self._client.observe)
        self._results()
        return {"rows": [["", self.summary]]}

    def _results(self) -> JsonObject:
        if self._client is None:
            return {}
        try:
            results = self._tracked(self._latest)
            if results != self._described:
                self.summary = self._tracked(partial(self._client.summary, results))
                self._described = results
            return dict(results)
        except (HostError, ValueError) as error:
            return {"error": str(error)}

    def _latest(self) -> Columns:
        assert self._client is not None
        return self._shell.asked(self._client.latest)

    def _execute(self, line: str) -> JsonObject:
        if len(line) > LONGEST_LINE:
            raise ShellError(f"a line has {LONGEST_LINE} characters at most")
        result = self._shell.execute(line, PAGE_COMMANDS)
        return {"rows": result.rows if result else [], "data": result.data if result else {}}

    def _read(self, name: str) -> JsonObject:
        try:
            return dict(self._tracked(lambda: self._execute(f"read {name}"))["data"]["values"])
        except (HostError, ValueError) as error:
            return {"error": str(error)}

    def _request(self, act: Callable[[], T]) -> "Future[T]":
        return self._thread.submit(self._tracked, act)

    def _tracked(self, act: Callable[[], T]) -> T:
        """Result of ``act``, with its outcome in ``link``; a refusal is an answer."""
        try:
            result = act()
        except CommandRefusedError:
            self.link.broken = False
            raise
        except HostError as error:
            self.link.failed += 1
            self.link.broken, self.link.error = True, str(error)
            raise
        self.link.broken = False
        return result


def _message(one: Message) -> JsonObject:
    fields = [
        {
            **field_json(f),
            "details": field_details(f),
            "group": f.group,
            "severity": f.severity.name.lower(),
        }
        for f in one.fields
    ]
    about = picked(one, "id", "name", "meaning", "supported", "extension")
    return about | {"risk": one.risk, "changes": one.has_side_effect, "fields": fields}
