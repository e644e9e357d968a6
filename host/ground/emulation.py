"""State and actions of a running emulation, as JSON for the control port."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.formats.recording import Control
from cubestack.host.clients.quaternions import attitude_columns
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.emulation.virtual_serial import PS_PER_S
from cubestack.host.errors import TargetError
from cubestack.host.ground.traces import LONGEST_S as TRACE_S
from cubestack.host.ground.traces import Bench, Trace

if TYPE_CHECKING:
    from concurrent.futures import Future

    from cubestack.emulator.ports.control import ControlPort
    from cubestack.host.emulation.history import History

JsonObject = dict[str, Any]


@dataclass
class Emulation:
    """Devices that share one virtual time. Only ``port`` may be used in other threads.

    Attributes:
        port: runs calls in the emulation's thread.
        emulated: the devices.
        ports: addresses of each device's serial lines.
        past: their history, to go back in time; or why there is none.
        bench: renders waveforms of the history.
    """

    port: "ControlPort"
    emulated: Sequence[AnyEmulated]
    ports: Mapping[str, Sequence[str]] = field(default_factory=dict)
    past: "History | str" = "nothing is recorded"
    bench: Bench = field(default_factory=Bench)

    def __post_init__(self) -> None:
        self._snapshots: dict[str, int] = {}
        self._at_start = {
            (one.device.name, name): crc32(picture.tobytes())
            for one in self.emulated
            for name, picture in one.board.pictures().items()
        }
        self._reset_views()

    def _reset_views(self) -> None:
        self._checksums: dict[tuple[str, str], int] = {}
        self._changed_s: dict[tuple[str, str], float] = {}

        past, emulated = self.past, self.emulated
        controls = map(EmulatedControls, emulated) if isinstance(past, str) else past.controls()
        names = (one.device.name for one in emulated)
        self._controls = dict(zip(names, controls, strict=True))

    def state(self) -> JsonObject:
        scheduler = self.port.scheduler
        assert scheduler is not None
        return {
            "time_s": self.port.kernel.now / PS_PER_S,
            "held": self.port.held,
            "pace": scheduler.pace.mode,
            "speed": scheduler.pace.speed,
            "snapshots": {name: ps / PS_PER_S for name, ps in self._snapshots.items()},
            "goes_back": not isinstance(self.past, str) and self.past.again,
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
        """Options, ports and faults of a device; raises TargetError for an unknown one."""
        one, controls = self.of(device), self._controls[device]
        return {
            "title": one.device.title,
            "chosen": dict(one.chosen),
            "seed": one.seed,
            "ports": list(self.ports.get(device, ())),
            "channels": list(controls.channels),
            "no_past": self.past if isinstance(self.past, str) else "",
            "faults": {
                kind: {
                    "targets": list(targets),
                    "parameters": list(controls.fault_parameters[kind]),
                }
                for kind, targets in one.board.faults.kinds().items()
            },
        }

    def log(self, device: str, since: int = 0) -> JsonObject:
        """Fault log from line ``since`` on, and its number of lines."""
        self.of(device)
        lines = self._controls[device].fault_log()
        return {"log": lines[max(0, since) :], "count": len(lines)}

    def pictures(self, device: str) -> JsonObject:
        """Images in its memories, when a change of each was first detected, and if one is there.

        ``stored`` is false for what a memory holds at power-up.
        """
        found = {}
        for name, picture in self.of(device).board.pictures().items():
            key, known = (device, name), crc32(picture.tobytes())
            if self._checksums.get(key) != known:
                self._checksums[key] = known
                self._changed_s[key] = self.port.kernel.now / PS_PER_S
            rows, columns = picture.shape
            found[name] = {
                **{"rows": rows, "columns": columns, "changed_s": self._changed_s[key]},
                "stored": known != self._at_start[key],
            }
        return {"pictures": found}

    def picture(self, device: str, name: str) -> NDArray[np.uint8]:
        """A copy of the image; raises TargetError for an unknown one."""
        pictures = self.of(device).board.pictures()
        if name not in pictures:
            raise TargetError(f"no image {name!r}; known: {', '.join(pictures) or 'none'}")
        return pictures[name].copy()

    def pins(self, device: str) -> JsonObject:
        """Level of each pin, and what the firmware drives there; ValueError for connected pins."""
        pins = self.of(device).pins
        return {"pins": {pin: {"level": pins[pin], "output": pins.output(pin)} for pin in pins}}

    def act(
        self,
        device: str,
        words: Sequence[str],
        text: str = "",
        files: Mapping[str, bytes] = MappingProxyType({}),
    ) -> None:
        """Execute a shell command; ``text`` is the content of the file that it names.

        ``files`` are those that the text names; no others are opened.

        Raises ValueError for an invalid command, RuntimeError while going back in time.
        """
        self.of(device)
        if not isinstance(self.past, str) and self.past.again:
            raise RuntimeError("the emulation is going back in time; wait until it arrives")
        self._controls[device].act(Control(self.port.kernel.now, tuple(words), text, files))

    def run_to(self, to_s: float) -> "Future[int]":
        """Run to a time as fast as possible and hold; done on arrival."""
        if not 0 <= to_s <= LATEST_S:
            raise ValueError(f"to_s must be 0 to {LATEST_S:g} s, not {to_s:g}")
        return self.port.run_to(round(to_s * PS_PER_S))

    def snapshot(self, name: str) -> None:
        self._recorded()
        if len(self._snapshots) >= MOST_SNAPSHOTS and name not in self._snapshots:
            raise ValueError(f"at most {MOST_SNAPSHOTS} snapshots are possible")
        self._snapshots[name] = self.port.kernel.now

    def back(self, to: float | str) -> "Future[int]":
        """Go back to a time in s or a snapshot, and hold; done on arrival.

        It replays the history as fast as possible. Raises ValueError for a future time.
        """
        past = self._recorded()
        if isinstance(to, str):
            if to not in self._snapshots:
                known = ", ".join(self._snapshots) or "none"
                raise ValueError(f"no snapshot {to!r}; known: {known}")
            to_ps = self._snapshots[to]
        else:
            to_ps = round(to * PS_PER_S) if 0 <= to <= LATEST_S else -1
        now_ps = self.port.kernel.now
        if not 0 <= to_ps <= now_ps:
            raise ValueError(
                f"to must be 0 to {now_ps / PS_PER_S:.6f} s, the current time, not {to}"
            )
        self.port.pause()
        past.begin_again(to_ps)
        self._reset_views()
        self._snapshots = {name: ps for name, ps in self._snapshots.items() if ps <= to_ps}
        arrived = self.port.run_to(to_ps)
        arrived.add_done_callback(lambda _arrived: past.arrive())
        return arrived

    def recording(self, device: str) -> tuple[Path, int]:
        """The recording of a device's ports, and its current size in bytes."""
        one, past = self.of(device), self._recorded()
        path = past.file(self.emulated.index(one))
        return path, path.stat().st_size

    def trace(self, device: str, from_s: float, to_s: float) -> Trace:
        """A waveform of a past time span; raises ValueError for an invalid span."""
        now_s = self.port.kernel.now / PS_PER_S
        if not 0 <= from_s < to_s <= now_s or to_s - from_s > TRACE_S:
            span = f"at most {TRACE_S:g} s long and before the current time, {now_s:.6f} s"
            raise ValueError(f"a waveform must be {span}, not {from_s:g} to {to_s:g} s")
        return Trace(self.bench, *self.recording(device), from_s, to_s)

    def _recorded(self) -> "History":
        if isinstance(self.past, str):
            raise TargetError(f"no way back: {self.past}")
        return self.past

    def of(self, name: str) -> AnyEmulated:
        """A device by name; raises TargetError for an unknown one."""
        for one in self.emulated:
            if one.device.name == name:
                return one
        known = ", ".join(one.device.name for one in self.emulated)
        raise TargetError(f"no device {name!r} is emulated here; known: {known}")


def _columns(truths: Mapping[str, NDArray[np.float64]]) -> dict[str, float | None]:
    """Truth values by the column names of the results."""
    found: dict[str, float | None] = {}
    for name, truth in truths.items():
        if truth.size == ATTITUDE:
            found |= attitude_columns(truth)
        else:
            angles = zip(ANGLES, map(float, truth), strict=True)
            found |= {f"{name}_{angle}_deg": value for angle, value in angles}
    return found


ATTITUDE, ANGLES = 4, ("alpha", "beta")
"""Size of an attitude's truth; names of the angles of a direction."""

MOST_SNAPSHOTS = 100

LATEST_S = 1e8
"""Latest virtual time: three years."""
