"""What a program can see and do of a running emulation, as JSON has it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.formats.recording import Control
from cubestack.host.clients.quaternions import attitude_columns
from cubestack.host.devices.controls import EmulatedControls
from cubestack.host.devices.emulated import AnyEmulated
from cubestack.host.devices.virtual_serial import PS_PER_S
from cubestack.host.errors import TargetError

if TYPE_CHECKING:
    from concurrent.futures import Future

    from cubestack.emulator.ports.control import ControlPort

JsonObject = dict[str, Any]


@dataclass
class Emulation:
    """Devices that share one virtual time. Everything but ``port`` is for the emulation's thread.

    Attributes:
        port: by which its thread is reached.
        emulated: the devices.
        ports: of each device, where its serial lines are served.
    """

    port: "ControlPort"
    emulated: Sequence[AnyEmulated]
    ports: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Nothing has been looked at."""
        self._known: dict[tuple[str, str], int] = {}
        self._changes: dict[tuple[str, str], float] = {}

    @cached_property
    def _controls(self) -> dict[str, EmulatedControls]:
        return {one.device.name: EmulatedControls(one) for one in self.emulated}

    def state(self) -> JsonObject:
        """How it is now."""
        scheduler = self.port.scheduler
        assert scheduler is not None
        return {
            "time_s": self.port.kernel.now / PS_PER_S,
            "held": self.port.held,
            "pace": scheduler.pace.mode,
            "speed": scheduler.pace.speed,
            "devices": {one.device.name: self._state(one) for one in self.emulated},
        }

    def _state(self, one: AnyEmulated) -> JsonObject:
        controls = self._controls[one.device.name]
        return {
            "busy": one.board.busy(),
            "currents_ma": controls.currents(),
            "probes": dict(one.board.probes()),
            "truth": _columns(one.board.truths()),
            "faults_logged": len(one.board.faults.log),
        }

    def about(self, device: str) -> JsonObject:
        """What there is of one device; TargetError for one that there is not."""
        one, controls = self._of(device), self._controls[device]
        return {
            "title": one.device.title,
            "chosen": dict(one.chosen),
            "seed": one.seed,
            "ports": list(self.ports.get(device, ())),
            "channels": list(controls.channels),
            "faults": {
                kind: {
                    "targets": list(targets),
                    "parameters": list(controls.fault_parameters[kind]),
                }
                for kind, targets in one.board.faults.kinds().items()
            },
        }

    def log(self, device: str, since: int = 0) -> JsonObject:
        """What faults have done, from line ``since`` on; and how many lines there are."""
        self._of(device)
        lines = self._controls[device].fault_log()
        return {"log": lines[max(0, since) :], "count": len(lines)}

    def pictures(self, device: str) -> JsonObject:
        """Pictures in its memories, and when each was found to be another one than before."""
        found = {}
        for name, picture in self._of(device).board.pictures().items():
            key, known = (device, name), crc32(picture.tobytes())
            if self._known.get(key) != known:
                self._known[key] = known
                self._changes[key] = self.port.kernel.now / PS_PER_S
            rows, columns = picture.shape
            found[name] = {"rows": rows, "columns": columns, "changed_s": self._changes[key]}
        return {"pictures": found}

    def picture(self, device: str, name: str) -> NDArray[np.uint8]:
        """A copy of one of them; TargetError for one that there is not."""
        pictures = self._of(device).board.pictures()
        if name not in pictures:
            raise TargetError(f"no picture {name!r}; there is {', '.join(pictures) or 'none'}")
        return pictures[name].copy()

    def act(self, device: str, words: Sequence[str], text: str = "") -> None:
        """Do what the shell does with such words; ``text`` of a file that they name.

        Raises ValueError for what makes no sense.
        """
        self._of(device)
        self._controls[device].act(Control(self.port.kernel.now, tuple(words), text))

    def pause(self) -> None:
        """Hold virtual time."""
        self.port.pause()

    def resume(self) -> None:
        """Let it go on."""
        self.port.resume()

    def step(self, events: int) -> int:
        """Let so many events happen; returns how many did."""
        return self.port.step(events)

    def run_to(self, to_s: float) -> "Future[int]":
        """Go on to a time, as fast as it gets, and hold there; when it is there."""
        if not 0 <= to_s <= LATEST_S:
            raise ValueError(f"a time is 0 to {LATEST_S:g} s, not {to_s:g}")
        return self.port.run_to(round(to_s * PS_PER_S))

    def set_pace(self, pace: Literal["real", "fast"], speed: float) -> None:
        """Of virtual time."""
        self.port.set_pace(pace, speed)

    def _of(self, name: str) -> AnyEmulated:
        for one in self.emulated:
            if one.device.name == name:
                return one
        known = ", ".join(one.device.name for one in self.emulated)
        raise TargetError(f"no device {name!r} is emulated here; there is {known}")


def _columns(truths: Mapping[str, NDArray[np.float64]]) -> dict[str, float | None]:
    """What is true, by the columns in which a log has what was measured."""
    found: dict[str, float | None] = {}
    for name, truth in truths.items():
        if truth.size == ATTITUDE:
            found |= attitude_columns(truth)
        else:
            angles = zip(ANGLES, map(float, truth), strict=True)
            found |= {f"{name}_{angle}_deg": value for angle, value in angles}
    return found


ATTITUDE, ANGLES = 4, ("alpha", "beta")
"""Numbers of an attitude; what the two of a direction are called."""

LATEST_S = 1e8
"""Virtual time that can be run to: three years."""
