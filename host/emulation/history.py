"""History of devices since power-up. To go back to an earlier time, they are powered up again and
their recordings replayed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cubestack.emulator.faults.plan import Plan, parse_plan
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.ports.serial_port import SerialPort
from cubestack.emulator.recording.recorder import Recorder
from cubestack.emulator.recording.replay import Replay
from cubestack.firmware_model.formats.recording import BusTransfer, Recording, load_recording
from cubestack.firmware_model.formats.setup import Setup
from cubestack.host.devices.device import AnyDevice, Engine
from cubestack.host.devices.registry import device
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.emulated import AnyEmulated, power_up
from cubestack.host.emulation.records import create_file, start_recorder
from cubestack.host.recording.setups import written
from cubestack.host.terminal import say


@dataclass(frozen=True)
class Recipe:
    """The set-up of a device, to power it up again."""

    device: AnyDevice
    scene: Any
    plan: Plan | None
    setup: Setup
    baud: int | None
    options: dict[str, Any]

    @classmethod
    def of(cls, recording: Recording, setup: Setup) -> Recipe:
        """From a recording's header and ``setup``; raises ValueError for unknown options."""
        found = device(recording.device)
        options: dict[str, Any] = dict(setup.options)
        made = recording.setup
        if found.switches.declared() and "profile" not in options and not (made and made.target):
            options["profile"] = "extended"
            if made is not None:
                older = "it is older than they are, and runs extended"
                say(f"{recording.name} names no profile: {older}")
        unknown = options.keys() - {option.name for option in found.all_options}
        if unknown:
            raise ValueError(f"{recording.name}: its setup has an unknown option {min(unknown)!r}")
        with nullcontext() if setup.scene is None else written(setup.scene) as path:
            scene = found.scene(path)
        faults = setup.faults
        plan = None if faults is None else parse_plan(faults.text, faults.name)
        return cls(found, scene, plan, setup, next(iter(recording.bauds.values()), None), options)

    def make(self, engine: Engine, **more: Any) -> AnyEmulated:
        """Power it up with its fault plan; ``more`` are keywords of ``power_up``."""
        options = self.options | more
        seed, baud = self.setup.seed, self.baud
        made = power_up(self.device, self.scene, seed=seed, engine=engine, baud=baud, **options)
        if self.plan is not None:
            made.faults.load(self.plan)
        return made


@dataclass
class _Kept:
    """A device's file."""

    path: Path
    recorder: Recorder
    stack: ExitStack


class History:
    """Records devices that share one virtual time, and rebuilds them as they were.

    Attributes:
        devices: the present devices; ``begin_again`` replaces them.
        ports: (index of the device, name of the line, port) of each serial line. No byte passes
            them during a replay.
        bus: master of their I2C bus, likewise blocked.
        on_arrival: called with each device when the replay has reached its time.
    """

    ports: Sequence[tuple[int, str, SerialPort]] = ()
    bus: I2cAdapter | None = None

    def __init__(
        self,
        devices: list[AnyEmulated],
        setups: Sequence[Setup],
        paths: Sequence[Path],
        engine: Engine = "auto",
    ) -> None:
        """Record ``devices``, set up by ``setups``, in files; call it before any port opens.

        Raises ValueError for a file that cannot be written.
        """
        self.devices = devices
        self.on_arrival: Callable[[AnyEmulated], None] = lambda _made: None
        self._engine = engine
        self._kept = [self._keep(*one) for one in zip(devices, setups, paths, strict=True)]
        self._replays: list[Replay] = []

    @property
    def again(self) -> bool:
        return bool(self._replays)

    def controls(self) -> list[EmulatedControls]:
        return [EmulatedControls(one) for one in self.devices]

    def file(self, number: int) -> Path:
        self._kept[number].recorder.flush()
        return self._kept[number].path

    def begin_again(self, end_ps: int) -> None:
        """Power all devices up again at time 0 of their kernel, and replay.

        All actions up to ``end_ps`` are repeated until ``arrive``. Raises ValueError before it
        changes anything.
        """
        recordings = [load_recording(self.file(number)) for number in range(len(self.devices))]
        begun = [one.until(end_ps) for one in recordings]
        recipes = [Recipe.of(one, one.setup or Setup("")) for one in begun]
        paths = [one.path for one in self._kept]
        self.arrive()
        kernel = self.devices[0].board.kernel
        for _, _, port in self.ports:
            port.pull()
        if self.bus is not None:
            self.bus.pull()
        self.close()
        for one in self.devices:
            one.close()
        kernel.restart()
        first = recipes[0].make(self._engine, kernel=kernel)
        rest = [recipe.make(self._engine, beside=first) for recipe in recipes[1:]]
        self.devices[:] = [first, *rest]
        setups = [recipe.setup for recipe in recipes]
        self._kept = [self._keep(*one) for one in zip(self.devices, setups, paths, strict=True)]
        controls = self.controls()
        self._replays = [
            _replay(one, made, control.act, alone=not number)
            for number, (one, made, control) in enumerate(
                zip(begun, self.devices, controls, strict=True)
            )
        ]

    def arrive(self) -> None:
        for replay in self._replays:
            replay.stop()
        self._replays.clear()
        boards = [one.board for one in self.devices]
        for number, line, port in self.ports:
            port.plug(boards[number].uarts[line])
        if self.bus is not None:
            self.bus.plug(boards[0].i2c_bus)
        for one in self.devices:
            self.on_arrival(one)

    def close(self) -> None:
        """Stop recording; the files stay."""
        for one in self._kept:
            one.stack.close()

    def _keep(self, made: AnyEmulated, setup: Setup, path: Path) -> _Kept:
        with ExitStack() as stack:
            recorder = start_recorder(made, create_file(path, stack), setup)
            stack.callback(recorder.close)
            return _Kept(path, recorder, stack.pop_all())


def _replay(
    recording: Recording, made: AnyEmulated, act: Callable[[Any], None], *, alone: bool
) -> Replay:
    """Replay a recording's host; only one replays the transfers of a shared bus."""
    if not alone:
        own = tuple(one for one in recording.events if not isinstance(one, BusTransfer))
        recording = replace(recording, events=own)
    board = made.board
    return Replay(recording, board.kernel, board.uarts, board.i2c_bus, act)
