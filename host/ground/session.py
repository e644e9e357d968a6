"""A target that pages look at: opened once, asked by one thread, in the shell's words."""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from cubestack.firmware_model.interface.codec.message import Message
from cubestack.host.clients.contract import Columns, DeviceClient
from cubestack.host.emulation.remote_controls import RemoteControls
from cubestack.host.errors import CommandRefusedError, HostError
from cubestack.host.export.field_text import field_details, field_json, picked
from cubestack.host.export.parquet import missing as parquet_missing
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.ground.emulators import Emulator, SentFile
from cubestack.host.ground.magnitudes import magnitude
from cubestack.host.ground.playback import PlaybackClient
from cubestack.host.ground.results import ResultLog
from cubestack.host.ground.tables import (
    pointer_row,
    read_sensor_register,
    sensor_rows,
    setting_rows,
)
from cubestack.host.ground.transfer import Transfer, grey_values
from cubestack.host.pictures.overlay import Overlay, star_overlay
from cubestack.host.shell.language import Shell
from cubestack.host.shell.names import Names
from cubestack.host.shell.result import ShellError
from cubestack.host.targets import Target

T = TypeVar("T")

FROM_A_PAGE = ("read", "write", "dump", "list", "bench", "raw", "fault", "power", "time", "help")
"""Commands of the shell that touch no file of this machine, and end."""

LONGEST_LINE = 10_000


@dataclass
class Link:
    """What became of what pages asked for.

    Attributes:
        failed: how much had no right answer in the end.
        broken: whether the last had none.
        error: of the last failure.
    """

    failed: int = 0
    broken: bool = False
    error: str = ""


class TargetSession:
    """Attributes:
    target: that is looked at.
    link: how its link is.
    carried: the latest picture that went over the wire; None for none.
    begun: how often its emulation was started again.
    log: results that were read.
    """

    def __init__(self, target: Target, emulator: Emulator | None = None) -> None:
        """Look at ``target``, which is closed with this, as is the ``emulator`` that it is of."""
        self.target, self.link, self._emulator = target, Link(), emulator
        self.carried: Transfer | None = None
        self.begun = 0
        self.log = ResultLog()
        self._shell = Shell(target)
        self._thread = ThreadPoolExecutor(1, "target")

    @cached_property
    def about(self) -> JsonObject:
        """What it is, what can be asked and commanded, and what can not, with the reason."""
        target, interface, controls = self.target, self.target.interface, self.controls
        missing = {} if controls else {"controls": f"{target.name} has no control port"}
        if controls and controls.no_past:
            missing["past"] = f"there is no way back: {controls.no_past}"
        if target.device is None or target.device.scene_form is None:
            missing["scene_form"] = f"{interface.name} does not tell the keys of its scenes"
        if target.line is None:
            missing["raw"] = f"{target.name} is no serial line"
        if self._overlay is None:
            missing["found"] = f"{interface.name} does not tell what it found in a picture"
        if not self._has("latest"):
            missing["results"] = f"{interface.name} has no results to log"
        if not self._has("picture"):
            missing["download"] = f"{interface.name} sends no picture"
        if not self._has("upload"):
            missing["upload"] = f"{interface.name} has no image upload"
        if self.played is not None:
            for what in ("send", "download", "upload", "found", "sensor_registers"):
                missing[what] = f"{target.name} is a recording, which takes no telecommand"
        if target.registers is None:
            missing["registers"] = f"no registers of {interface.name} are within reach here"
        if target.device is None or target.device.image_sensor is None:
            none = f"{interface.name} reads no single register of its image sensor"
            missing["sensor_registers"] = none
        if self._emulator is None:
            missing["restart"] = f"no emulation of {target.name} was started by this page"
        if controls is None and target.recorded is None:
            missing["recording"] = f"{target.name} is not recorded: begin with --record FILE"
        elif controls is not None and controls.no_past:
            missing["recording"] = controls.no_past
        if none := parquet_missing():
            missing["parquet"] = none
        if target.service_port is None:
            missing["bench"] = "no line with the bench protocol is open"
        return {
            "name": target.name,
            "device": interface.name,
            "telemetries": [_message(one) for one in interface.telemetries],
            "telecommands": [_message(one) for one in interface.telecommands],
            "registers": [pointer_row(one) for one in Names(target).registers],
            "settings": setting_rows(target.device) if target.device else [],
            "sensor_registers": sensor_rows(target.device) if target.device else [],
            "faults": list(controls.faults) if controls else [],
            "fault_parameters": dict(controls.fault_parameters) if controls else {},
            "channels": list(controls.channels) if controls else [],
            "chosen": controls.chosen if controls else {},
            "options": self._emulator.rows(controls.chosen) if self._emulator and controls else [],
            "begun": self.begun,
            "sources": list(self._client.picture_sources) if self._client else [],
            "played": self.played.state if self.played else None,
            "missing": missing,
        }

    @property
    def health(self) -> JsonObject:
        """How the link is: ``Link``, and what went over the wire as ``Exchanges`` counts it."""
        registers, passed = self.target.registers, self.target.node.exchanges
        return vars(self.link) | vars(passed if registers is None else passed + registers.exchanges)

    @property
    def controls(self) -> RemoteControls | None:
        """Those of its emulation in another process."""
        controls = self.target.controls
        return controls if isinstance(controls, RemoteControls) else None

    @property
    def played(self) -> PlaybackClient | None:
        return self.target.node if isinstance(self.target.node, PlaybackClient) else None

    def do(self, line: str) -> "Future[JsonObject]":
        """What a line of the shell gives: ``rows`` for a reader, and ``data``.

        Its exception: ShellError, InterfaceError, HostError.
        """
        return self._thread.submit(self._asked, lambda: self._do(line))

    def read(self, names: Iterable[str]) -> "Future[JsonObject]":
        """Telemetry by name: what it has, or the ``error`` in place of it."""
        return self._thread.submit(lambda: {name: self._read(name) for name in names})

    def found(self, picture: str) -> "Future[JsonObject]":
        """What it found in the memory called ``picture``: ``marks`` with column, row, name, empty
        of unknown ones, and V magnitude, None where it has none; ``lines`` of columns and rows."""
        return self._thread.submit(self._asked, lambda: self._found(picture))

    def sensor_register(self, name: str) -> "Future[JsonObject]":
        """A register of its image sensor, as ``read_sensor_register`` gives it."""
        return self._thread.submit(self._asked, lambda: self._sensor_register(name))

    def results(self) -> "Future[JsonObject]":
        """Its latest result as a line of a log, or the ``error`` in place of it."""
        return self._thread.submit(self._results)

    def transfer(self, what: str, source: str | None = None, content: bytes = b"") -> Transfer:
        """Start a "download", of the memory ``source``, or an "upload" of a picture file.

        Nothing else is asked meanwhile. ValueError where it can not be, or another one runs.
        """
        client = self._client
        if what in self.about["missing"]:
            raise ValueError(self.about["missing"][what])
        if self.carried is not None and self.carried.runs:
            raise ValueError("another picture is on its way")
        assert client is not None
        if source is not None and source not in client.picture_sources:
            raise ValueError(f"no memory {source!r}; known: {', '.join(client.picture_sources)}")
        if what == "download":
            self.carried = Transfer(what, lambda progress: client.picture(source, progress))
        else:
            picture = grey_values(content)
            self.carried = Transfer(what, lambda progress: client.upload(picture, progress))
        self._thread.submit(self._asked, self.carried.run)
        return self.carried

    def restart(
        self, options: Mapping[str, Any], files: Mapping[str, SentFile]
    ) -> "Future[JsonObject]":
        """Emulate it anew, as ``Emulator.restart`` does: ``rows`` for a reader.

        ValueError where it can not be, or a picture is on its way.
        """
        if self._emulator is None:
            raise ValueError(self.about["missing"]["restart"])
        if self.carried is not None and self.carried.runs:
            raise ValueError("a picture is on its way")
        return self._thread.submit(self._restart, self._emulator, options, files)

    def close(self) -> None:
        if self.carried is not None:
            self.carried.give_up()
        self._thread.shutdown(cancel_futures=True)
        self.target.close()
        self.log.close()
        if self._emulator is not None:
            self._emulator.close()

    def _restart(
        self, emulator: Emulator, options: Mapping[str, Any], files: Mapping[str, SentFile]
    ) -> JsonObject:
        before = self.target
        self.target, end = emulator.restart(before, options, files)
        self._shell, self.link, self.carried = Shell(self.target), Link(), None
        self.begun += 1  # before what tells of it is told anew
        for name in ("about", "_client"):
            vars(self).pop(name, None)
        before.close()
        end()
        return {"rows": list(self.about["chosen"].items())}

    @cached_property
    def _client(self) -> DeviceClient | None:
        device = self.target.device
        return None if device is None else device.client(self.target.node)

    def _has(self, method: str) -> bool:
        own = getattr(type(self._client), method, None)
        return own is not None and own is not getattr(DeviceClient, method)

    @property
    def _overlay(self) -> Callable[[Any, str], Overlay] | None:
        own = None if self.target.device is None else self.target.device.overlay
        return own or (star_overlay if self._has("stars") else None)

    def _found(self, picture: str) -> JsonObject:
        if self._overlay is None:
            raise ValueError(self.about["missing"]["found"])
        found = self._overlay(self._client, picture)
        return {
            "marks": [
                {
                    "x": one.x_px,
                    "y": one.y_px,
                    "name": one.name,
                    "v_mag": None if one.hipparcos is None else magnitude(one.hipparcos),
                }
                for one in found.marks
            ],
            "lines": [line.tolist() for line in found.lines],
        }

    def _sensor_register(self, name: str) -> JsonObject:
        if self.target.device is None:
            raise ValueError(self.about["missing"]["sensor_registers"])
        return read_sensor_register(self.target.device, self.target.node, name)

    def _results(self) -> JsonObject:
        try:
            return {} if self._client is None else dict(self._asked(self._latest))
        except (HostError, ValueError) as error:
            return {"error": str(error)}

    def _latest(self) -> Columns:
        assert self._client is not None
        return self._shell.asked(self._client.latest)

    def _do(self, line: str) -> JsonObject:
        if len(line) > LONGEST_LINE:
            raise ShellError(f"a line has {LONGEST_LINE} characters at most")
        word = line.split(maxsplit=1)[0] if line.split() else ""
        if word in self._shell.commands and word not in FROM_A_PAGE:
            raise ShellError(f"{word}: not from a page; there are {', '.join(FROM_A_PAGE)}")
        result = self._shell.execute(line)
        return {"rows": result.rows if result else [], "data": result.data if result else {}}

    def _read(self, name: str) -> JsonObject:
        try:
            return dict(self._asked(lambda: self._do(f"read {name}"))["data"]["values"])
        except (HostError, ValueError) as error:
            return {"error": str(error)}

    def _asked(self, act: Callable[[], T]) -> T:
        try:
            found = act()
        except CommandRefusedError:
            self.link.broken = False
            raise
        except HostError as error:
            self.link.failed += 1
            self.link.broken, self.link.error = True, str(error)
            raise
        self.link.broken = False
        return found


def _message(one: Message) -> JsonObject:
    fields = [{**field_json(f), "details": field_details(f)} for f in one.fields]
    about = picked(one, "id", "name", "meaning", "supported", "extension")
    return about | {"changes": one.has_side_effect, "fields": fields}
