"""What a program can see and do of a running emulation, as JSON has it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.formats.recording import Control
from cubestack.host.clients.quaternions import attitude_columns
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.emulation.virtual_serial import PS_PER_S
from cubestack.host.errors import TargetError
from cubestack.host.ground import scenes
from cubestack.host.ground.traces import LONGEST_S as TRACE_S
from cubestack.host.ground.traces import Bench, Trace

if TYPE_CHECKING:
    from concurrent.futures import Future

    from cubestack.emulator.ports.control import ControlPort
    from cubestack.host.emulation.history import History

JsonObject = dict[str, Any]


@dataclass
class Emulation:
    """Devices that share one virtual time. Everything but ``port`` is for the emulation's thread.

    Attributes:
        port: by which its thread is reached.
        emulated: the devices.
        ports: of each device, where its serial lines are served.
        past: what was done to them, by which one can go back; or why there is none.
        bench: where waveforms of that are made.
    """

    port: "ControlPort"
    emulated: Sequence[AnyEmulated]
    ports: Mapping[str, Sequence[str]] = field(default_factory=dict)
    past: "History | str" = "nothing is recorded"
    bench: Bench = field(default_factory=Bench)

    def __post_init__(self) -> None:
        self._snapshots: dict[str, int] = {}
        self._look_anew()

    def _look_anew(self) -> None:
        self._known: dict[tuple[str, str], int] = {}
        self._changes: dict[tuple[str, str], float] = {}

        made = (
            map(EmulatedControls, self.emulated)
            if isinstance(self.past, str)
            else self.past.controls()
        )
        names = (one.device.name for one in self.emulated)
        self._controls = dict(zip(names, made, strict=True))

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
        """What there is of one device; TargetError for one that there is not."""
        one, controls = self._of(device), self._controls[device]
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

    def scene_keys(self, device: str) -> JsonObject:
        return scenes.keys(self._of(device).device)

    def scene(self, device: str) -> JsonObject:
        return scenes.present(self._of(device))

    def look(self, device: str, table: Mapping[str, Any]) -> JsonObject:
        return scenes.look(self._of(device), table)

    def act(self, device: str, words: Sequence[str], text: str = "") -> None:
        """Do what the shell does with such words; ``text`` of a file that they name.

        Raises ValueError for what makes no sense.
        """
        self._of(device)
        if not isinstance(self.past, str) and self.past.again:
            raise RuntimeError("it goes back: wait until it is there")
        self._controls[device].act(Control(self.port.kernel.now, tuple(words), text))

    def pause(self) -> None:
        self.port.pause()

    def resume(self) -> None:
        self.port.resume()

    def step(self, events: int) -> int:
        """Let so many events happen; returns how many did."""
        return self.port.step(events)

    def run_to(self, to_s: float) -> "Future[int]":
        """Go on to a time, as fast as it gets, and hold there; when it is there."""
        if not 0 <= to_s <= LATEST_S:
            raise ValueError(f"a time is 0 to {LATEST_S:g} s, not {to_s:g}")
        return self.port.run_to(round(to_s * PS_PER_S))

    def snapshot(self, name: str) -> None:
        """Remember now as ``name``, to go back to."""
        self._recorded()
        if len(self._snapshots) >= MOST_SNAPSHOTS and name not in self._snapshots:
            raise ValueError(f"{MOST_SNAPSHOTS} snapshots are kept at most")
        self._snapshots[name] = self.port.kernel.now

    def back(self, to: float | str) -> "Future[int]":
        """Go back to a time in s, or to a snapshot, and hold there; when it is there.

        All that was done by then is done again, as fast as it gets; ValueError for a time that was
        not yet.
        """
        past = self._recorded()
        if isinstance(to, str):
            if to not in self._snapshots:
                known = ", ".join(self._snapshots) or "none"
                raise ValueError(f"no snapshot {to!r}; there are {known}")
            to_ps = self._snapshots[to]
        else:
            to_ps = round(to * PS_PER_S) if 0 <= to <= LATEST_S else -1
        now_ps = self.port.kernel.now
        if not 0 <= to_ps <= now_ps:
            raise ValueError(f"back is 0 to {now_ps / PS_PER_S:.6f} s, which it is now, not {to}")
        self.port.pause()
        past.begin_again(to_ps)
        self._look_anew()
        self._snapshots = {name: ps for name, ps in self._snapshots.items() if ps <= to_ps}
        arrived = self.port.run_to(to_ps)
        arrived.add_done_callback(lambda _arrived: past.arrive())
        return arrived

    def recording(self, device: str) -> tuple[Path, int]:
        """The file with all that passed a device's ports, and how long it is by now."""
        one, past = self._of(device), self._recorded()
        path = past.file(self.emulated.index(one))
        return path, path.stat().st_size

    def trace(self, device: str, from_s: float, to_s: float) -> Trace:
        """A waveform of a span of time up to now; ValueError for another span."""
        now_s = self.port.kernel.now / PS_PER_S
        if not 0 <= from_s < to_s <= now_s or to_s - from_s > TRACE_S:
            span = f"at most {TRACE_S:g} s of the time up to now, {now_s:.6f} s"
            raise ValueError(f"a waveform has {span}, not {from_s:g} to {to_s:g} s")
        return Trace(self.bench, *self.recording(device), from_s, to_s)

    def _recorded(self) -> "History":
        if isinstance(self.past, str):
            raise TargetError(f"there is no way back: {self.past}")
        return self.past

    def set_pace(self, pace: Literal["real", "fast"], speed: float) -> None:
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

MOST_SNAPSHOTS = 100

LATEST_S = 1e8
"""Virtual time that can be run to: three years."""
