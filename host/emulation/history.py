"""History of devices since power-up. To go back to an earlier time, they are powered up again and
their recordings replayed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
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
from cubestack.host.emulation.emulated import AnyEmulated, power_up, scene_files
from cubestack.host.emulation.records import create_record, start_recorder
from cubestack.host.output import Outputs
from cubestack.host.recording.record_file import RecordFile
from cubestack.host.recording.setups import split_mark, written
from cubestack.host.terminal import say


@dataclass(frozen=True)
class Recipe:
    """The set-up of a device, to power it up again."""

    device: AnyDevice
    scene: Any
    files: Mapping[str, bytes]
    plan: Plan | None
    setup: Setup
    baud: int | None
    options: dict[str, Any]

    @classmethod
    def of(
        cls,
        recording: Recording,
        setup: Setup,
        given: Mapping[str, Any] = MappingProxyType({}),
        *,
        own: bool = False,
    ) -> Recipe:
        """From a recording's header and ``setup``, with the options ``given`` in place of its own.

        Files that the recording names and does not contain are opened if it is this process's
        ``own``. Raises ValueError for such files, and for unknown options.
        """
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
        if not own:
            options = {name: one for name, one in options.items() if name not in given}
            _check_names(recording.name, found, options, setup.files)
        options |= given
        with nullcontext() if setup.scene is None else written(setup.scene) as path:
            scene = found.scene(path)
            files = scene_files(path)
        faults = setup.faults
        plan = None if faults is None else parse_plan(faults.text, faults.name)
        baud = next(iter(recording.bauds.values()), None)
        return cls(found, scene, files, plan, setup, baud, options)

    def make(self, engine: Engine, **more: Any) -> AnyEmulated:
        """Power it up with its fault plan; ``more`` are keywords of ``power_up``."""
        options = self.options | more
        seed, baud = self.setup.seed, self.baud
        with TemporaryDirectory(prefix="cubestack-") as folder:
            for name, content in self.setup.files.items():
                (Path(folder) / name).write_bytes(content)
            here = {
                one.name: str(Path(folder) / path.name) + mark
                for one in self.device.all_options
                if one.is_file and (value := options.get(one.name))
                for path, mark in [split_mark(str(value))]
                if path.name in self.setup.files
            }
            given: dict[str, Any] = {"seed": seed, "engine": engine, "baud": baud}
            made = power_up(self.device, self.scene, **given, **options | here)
        made.files = self.files
        made.chosen = {name: str(options.get(name, one)) for name, one in made.chosen.items()}
        if self.plan is not None:
            made.faults.load(self.plan)
        return made


def _check_names(
    recording: str, found: AnyDevice, options: Mapping[str, Any], files: Mapping[str, bytes]
) -> None:
    """Raise ValueError for an option that names a file or folder that is not in it."""
    for one in found.all_options:
        value = options.get(one.name, "")
        if not isinstance(value, str):
            if one.metavar:
                raise ValueError(f"{recording}: {one.name} must be a text, not {value!r:.40}")
            continue
        names = any(word in one.metavar for word in ("FILE", "FOLDER"))
        if not names or value in ("", *one.known):
            continue
        if not one.is_file or split_mark(value)[0].name not in files:
            text = f"names the {one.name} {value!r}, which it does not contain"
            raise ValueError(f"{recording} {text}; {one.flag} gives it")


@dataclass
class _Kept:
    """A device's file."""

    path: Path
    file: RecordFile
    recorder: Recorder
    keep: Callable[[], None]  # gives the file its name
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
        largest: int | None = None,
    ) -> None:
        """Record ``devices``, set up by ``setups``, in files; call it before any port opens.

        A file ends at ``largest`` bytes. Raises ValueError for one that cannot be written.
        """
        self._largest = largest
        self.devices = devices
        self.on_arrival: Callable[[AnyEmulated], None] = lambda _made: None
        self._engine = engine
        self._kept = [self._keep(*one) for one in zip(devices, setups, paths, strict=True)]
        self._replays: list[Replay] = []

    @property
    def again(self) -> bool:
        return bool(self._replays)

    def keep(self) -> None:
        """Give the recordings their names; call it when everything has started."""
        for one in self._kept:
            one.keep()

    def controls(self) -> list[EmulatedControls]:
        return [EmulatedControls(one) for one in self.devices]

    def file(self, number: int) -> Path:
        """The recording of a device up to now; raises ValueError if it had to stop."""
        kept = self._kept[number]
        kept.recorder.flush()
        if kept.file.stopped:
            raise ValueError(f"the history is not whole: {kept.file.stopped}")
        kept.keep()
        return kept.path

    def begin_again(self, end_ps: int) -> None:
        """Power all devices up again at time 0 of their kernel, and replay.

        All actions up to ``end_ps`` are repeated until ``arrive``. Raises ValueError before it
        changes anything.
        """
        recordings = [load_recording(self.file(number)) for number in range(len(self.devices))]
        begun = [one.until(end_ps) for one in recordings]
        recipes = [Recipe.of(one, one.setup or Setup(""), own=True) for one in begun]
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
        self.keep()
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
        with Outputs() as stack:
            file = create_record(path, stack, self._largest)
            recorder = start_recorder(made, file, setup)
            stack.callback(recorder.close)
            return _Kept(path, file, recorder, stack.keep, stack.pop_all())


def _replay(
    recording: Recording, made: AnyEmulated, act: Callable[[Any], None], *, alone: bool
) -> Replay:
    """Replay a recording's host; only one replays the transfers of a shared bus."""
    if not alone:
        own = tuple(one for one in recording.events if not isinstance(one, BusTransfer))
        recording = replace(recording, events=own)
    board = made.board
    return Replay(recording, board.kernel, board.uarts, board.i2c_bus, act)
