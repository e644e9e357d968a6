"""A powered-up emulated device: virtual time, scene, faults and all its ports.

- ``client``: this project's client on the serial line.
- ``serial()``: pyserial's interface in virtual time, for Python drivers; repeatable to the byte.
- ``smbus()``: smbus2's interface, likewise.
- ``run()``: any program, on a pseudo-terminal.
- ``run_on_i2c()``: any program that opens /dev/i2c-N.

A serial line has one host at a time: a new one replaces the one before.
"""

from __future__ import annotations

import subprocess
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeAlias

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.host.clients.contract import Client, Closable, DeviceClient
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.device import AnyDevice, BoardT_co, ClientT_co, Device, Engine
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import devices, emulated_names
from cubestack.host.emulation.firmware import ProgramExit, run_to_exit
from cubestack.host.emulation.virtual_serial import PS_PER_S, VirtualSerial
from cubestack.host.recording.setups import read_document
from cubestack.host.terminal import busy
from cubestack.host.transport.smbus import CubeSMBus

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from cubestack.emulator.boards.contract import Board
    from cubestack.emulator.boards.pins import Pins
    from cubestack.emulator.faults.injector import Faults
    from cubestack.emulator.ports.realtime import RealtimeScheduler
    from cubestack.emulator.scene.pointing import Pointing


@dataclass(eq=False)
class EmulatedDevice(Closable, Generic[BoardT_co, ClientT_co]):
    """A powered-up device.

    Attributes:
        device: what it is.
        board: the emulated board, with all its parts.
        seed: of everything random.
        chosen: its profile and the switches that differ, as keywords of ``open_device``.
        follows: what moves its scene, e.g. an orbit; empty for a scene that stays as set.
        files: contents of the files that its scene file names, by the last part of their path.
        on_act: called after each recorded action from outside of the ports, with the shell's words,
            the text of the file they name, and the files that the text names.
    """

    device: Device[BoardT_co, ClientT_co]
    board: BoardT_co
    seed: int
    chosen: Mapping[str, str] = field(default_factory=dict)
    follows: str = field(default="", init=False)
    on_act: Callable[..., None] = field(
        default_factory=lambda: lambda *_what: None, init=False, repr=False
    )
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    _client: ClientT_co | None = field(default=None, init=False, repr=False)

    @property
    def client(self) -> ClientT_co:
        """This project's client on the serial line; it replaces any other host.

        It uses I2C if the serial line carries another protocol.
        """
        if self._client is None:
            self._client = self.device.client(node_client(self.board, self.device.interface))
        return self._client

    @property
    def faults(self) -> Faults:
        """Injects faults into it."""
        return self.board.faults

    @property
    def time_s(self) -> float:
        """Virtual time since power-up."""
        return self.board.kernel.now / PS_PER_S

    def wait(self, seconds: float) -> None:
        self.board.kernel.advance_to(self.board.kernel.now + round(seconds * PS_PER_S))

    @property
    def scene(self) -> Any:
        """The scene; set it to a scene, the path of a scene file, or None for the default."""
        return self.board.scene

    @scene.setter
    def scene(self, scene: Any) -> None:
        for key, value in scene_options(self.device, scene).items():
            if value != self.chosen.get(key, ""):
                raise ValueError(f"{scene}: {key} can only be chosen at power-up")
        self.board.scene = self.device.scene(scene)
        self.files = scene_files(scene)

    def point(
        self,
        quaternion: ArrayLike,
        rate_deg_s: ArrayLike = (0.0, 0.0, 0.0),
        *,
        nadir: ArrayLike | None = None,
        sun: ArrayLike | None = None,
        moon: ArrayLike | None = None,
        altitude_km: float | None = None,
    ) -> None:
        """Give it another attitude from the present virtual time on.

        Its axes are the camera axes of a star tracker, and the body axes of a satellite with a sun
        and a nadir sensor. Inertial axes are those of the stars; for a scene of Earth and Sun, any
        that the caller keeps to. What is not given stays as it was.

        Args:
            quaternion: (4,), scalar last, inertial axes to the device's.
            rate_deg_s: constant body rate (3,) until the next call, in the device's axes.
            nadir: direction (3,) of the Earth's centre from the satellite, inertial axes.
            sun: likewise of the Sun.
            moon: likewise of the Moon.
            altitude_km: of the satellite.

        Raises:
            ValueError: a value is invalid, or the scene cannot be pointed: an image file, a
                device on an orbit, or a sensor whose scene has no `pointed`.
        """
        from cubestack.emulator.scene.pointing import Pointing

        directions = {"nadir": nadir, "sun": sun, "moon": moon}
        self.follow(Pointing(quaternion, rate_deg_s, **directions, altitude_km=altitude_km))

    def follow(self, pointing: Pointing) -> None:
        """As ``point``, with its arguments in one value."""
        name, scene = self.device.name, self.board.scene
        if self.follows:
            raise ValueError(f"{name} cannot be pointed: {self.follows}")
        pointed = getattr(scene, "pointed", None)
        if pointed is None:
            raise ValueError(f"{name} cannot be pointed: its {type(scene).__name__} has no pointed")
        self.board.scene = pointed(pointing, self.time_s)
        self.on_act(("point", *pointing.words()), "")

    @property
    def pins(self) -> Pins:
        """Port pins by name; ValueError for a device whose pins are connected to other parts."""
        if self.board.pins is None:
            raise ValueError(f"the pins of {self.device.name} are not free; use a bare part")
        return self.board.pins

    def run_to_exit(self, timeout_s: float = 10.0) -> ProgramExit:
        """Let virtual time pass until its own firmware exits by semihosting.

        Raises TimeoutError, with what the program printed, if it does not exit in time.
        """
        return run_to_exit(self.board, timeout_s)

    # --- ports ----------------------------------------------------------------------------------

    def serial(self, timeout: float | None = 1.0, line: str = "") -> VirtualSerial:
        """A serial line, by default the first; it has pyserial's interface.

        ``timeout`` is in s of virtual time. Raises KeyError for an unknown line.
        """
        name = line or self.board.lines[0].name
        if name == self.board.lines[0].name:
            self._client = None
        return VirtualSerial(self.board.serial(name), self.board.uarts[name].form.baud, timeout)

    def smbus(self) -> CubeSMBus:
        """The I2C bus with smbus2's interface."""
        return CubeSMBus(link=self.board.i2c())

    def run(
        self,
        *command: str | Path,
        timeout_s: float = 60.0,
        pace: Literal["real", "fast"] = "fast",
        beside: Sequence[AnyEmulated] = (),
    ) -> subprocess.CompletedProcess[str]:
        """Run a program against the serial lines; returns exit status and output.

        Every "{port}" in ``command`` becomes the path of a pseudo-terminal; a further line has a
        suffix, as in "{port}.bench". Of devices ``beside`` this one it is their name in braces.
        Warns if the program sets another baud rate, parity or stop bits than the device has. Raises
        subprocess.TimeoutExpired after ``timeout_s`` of wall time.
        """
        from cubestack.emulator.i2cdev.scheduler import open_scheduler
        from cubestack.host.emulation.terminals import Terminals

        devices: list[AnyEmulated] = [self, *beside]
        with ExitStack() as stack:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="cubestack-"))
            for one in devices:
                one._client = None
            terminals = Terminals(devices, Path(folder), stack, report=warnings.warn)
            words = terminals.fill_in([str(word) for word in command])
            schedulers = [
                stack.enter_context(open_scheduler(kernel, endpoints, busy, pace=pace))
                for kernel, endpoints, busy in terminals.by_kernel()
            ]
            program = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            with ThreadPoolExecutor(len(schedulers)) as threads:
                done = threads.submit(_watch, program, timeout_s, schedulers)
                for scheduler in schedulers[1:]:
                    threads.submit(scheduler.run)
                schedulers[0].run()
                return done.result()

    def run_on_i2c(
        self, *command: str | Path, bus: int = 7, timeout_s: float = 60.0
    ) -> subprocess.CompletedProcess[str]:
        """Run a program that sees the device on /dev/i2c-``bus``; returns exit status and output.

        Raises subprocess.TimeoutExpired after ``timeout_s`` of wall time.
        """
        from cubestack.emulator.i2cdev.adapter import I2cAdapter
        from cubestack.emulator.i2cdev.running import emulated_bus, run_program
        from cubestack.host.devices.i2c_targets import i2c_targets

        adapter = I2cAdapter(self.board.kernel, self.board.i2c_bus)
        words = [str(word) for word in command]
        with (
            tempfile.TemporaryDirectory(prefix="cubestack-") as folder,
            tempfile.TemporaryFile("w+") as output,
            tempfile.TemporaryFile("w+") as errors,
        ):
            opened = emulated_bus(
                self.board.kernel,
                self.board.busy,
                adapter,
                Path(folder) / "bus",
                i2c_targets([self.device]),
            )
            try:
                status = run_program(
                    words,
                    bus,
                    opened,
                    pace="fast",
                    streams=(output.fileno(), errors.fileno()),
                    timeout_s=timeout_s,
                )
            finally:
                opened.port.close()
            output.seek(0)
            errors.seek(0)
            return subprocess.CompletedProcess(words, status, output.read(), errors.read())

    def close(self) -> None:
        """Power down."""
        self.board.close()


def node_client(board: Board, interface: Interface) -> Client:
    """A client on the satellite's serial line, or on I2C if that line carries another protocol."""
    if board.lines[0].has_node:
        return NodeClient(board.serial(), interface)
    bus = board.i2c()
    return I2cClient(bus, interface, wait=bus.wait)


#: Any powered-up device.
AnyEmulated: TypeAlias = "EmulatedDevice[Board, DeviceClient]"


def _watch(
    program: subprocess.Popen[str], timeout_s: float, schedulers: Sequence[RealtimeScheduler]
) -> subprocess.CompletedProcess[str]:
    """Wait for a program, then stop the schedulers."""
    try:
        output, errors = program.communicate(timeout=timeout_s)
        return subprocess.CompletedProcess(program.args, program.returncode, output, errors)
    except subprocess.TimeoutExpired:
        with program:  # closes the pipes unread: a child process may keep them open for ever
            program.kill()
        raise
    finally:
        for scheduler in schedulers:
            scheduler.stop()


def check_options(
    device: AnyDevice, options: Mapping[str, object], shown: Callable[[str], str] = str
) -> None:
    """Raise ValueError for options or values that ``device`` does not have.

    ``shown`` formats an option's name for the error.
    """
    own = {option.name: option for option in device.all_options}
    for name, value in options.items():
        if name not in own:
            owners = [
                one.name
                for one in devices(emulated_names())
                for option in one.all_options
                if option.name == name
            ]
            whose = f"an option of {', '.join(owners)}, not" if owners else "no option"
            raise ValueError(f"{shown(name)} is {whose} of {device.name}")
        try:
            own[name].check(value)
        except ValueError as error:
            raise ValueError(f"{name} of {device.name} {error}") from None


def scene_options(device: AnyDevice, scene: Any) -> dict[str, str]:
    """Device options in a scene file, as keywords of ``open_device``.

    Empty if ``scene`` is not the path of a file. Raises ValueError that names the file.
    """
    if not isinstance(scene, str | Path):
        return {}
    from cubestack.emulator.scene.file import device_keys

    try:
        found = device_keys(Path(scene))
        check_options(device, found)
        device.switches.of(found.get("profile", DEFAULT_PROFILE), found.get("set", ""))
    except ValueError as error:
        raise ValueError(f"{scene}: {error}") from None
    return found


def scene_files(scene: Any) -> Mapping[str, bytes]:
    """Contents of the files that a scene file names; empty if ``scene`` is not its path."""
    return read_document(Path(scene)).files if isinstance(scene, str | Path) else {}


def power_up(
    device: Device[BoardT_co, ClientT_co],
    scene: Any = None,
    *,
    seed: int = 0,
    engine: Engine = "auto",
    beside: AnyEmulated | None = None,
    **options: Any,
) -> EmulatedDevice[BoardT_co, ClientT_co]:
    """Power up ``device``; takes the arguments of ``open_device`` and any keyword of its board.

    Profile and switches default to those of the scene file.
    """
    from cubestack.emulator.native.cache import reported

    chosen = {}
    if beside is not None:
        options |= {"kernel": beside.board.kernel, "i2c_bus": beside.board.i2c_bus}
    if device.switches.declared():
        options = scene_options(device, scene) | options
        profile, changes = options.pop("profile", DEFAULT_PROFILE), options.pop("set", "")
        options["switches"] = device.switches.of(profile, changes)
        chosen = {"profile": profile, **({"set": changes} if changes else {})}
    else:
        scene_options(device, scene)  # there are none
    with reported(busy):  # the first start compiles
        board = device.open_board(device.scene(scene), seed=seed, engine=engine, **options)
    if board.firmware:
        chosen["firmware"] = board.firmware
    return EmulatedDevice(device, board, seed, chosen, files=scene_files(scene))


def open_device(
    name: str,
    scene: Any = None,
    *,
    seed: int = 0,
    engine: Engine = "auto",
    baud: int | None = None,
    beside: AnyEmulated | None = None,
    **options: Any,
) -> AnyEmulated:
    """Power up a registered device.

    Args:
        name: of the device or part, one of ``emulated_names()``.
        scene: what its cameras see: a scene, the path of a scene file, or None for the default.
        seed: of everything random.
        engine: how its FPGA is run.
        baud: of its first serial line; None for the published rate.
        beside: another device that shares its virtual time and I2C bus.
        options: of this device's board; see ``cubestack emulate --help``.

    Raises:
        TargetError: no device has that name.
        ValueError: a scene or an option is invalid; the text says which.
    """
    device = registered(name)
    check_options(device, options)
    return power_up(device, scene, seed=seed, engine=engine, baud=baud, beside=beside, **options)
