"""An emulated device in a test of a driver: virtual time, scene, faults, and all its ports.

- ``serial()``: pyserial's interface in virtual time, for drivers in Python; repeatable to the byte.
- ``smbus()``: smbus2's interface, likewise.
- ``run()``: any program, on a pseudo-terminal.
- ``run_on_i2c()``: any program that opens /dev/i2c-N.
- ``client``: this project's own, to look at the device beside the driver.

Only one host is at the serial line at a time: plugging one in takes out the one before.
"""

from __future__ import annotations

import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.boards import cubesense_scene, cubestar_scene
from cubestack.host.transport.smbus import CubeSMBus

if TYPE_CHECKING:
    from cubestack.emulator.faults.injector import Faults
    from cubestack.emulator.ports.direct import DirectSerial
    from cubestack.host.cli.session import Engine

__all__ = ["EmulatedDevice", "VirtualSerial", "open_cubesense_device", "open_cubestar_device"]

PS_PER_S = 10**12
PORT = "{port}"
"""What ``run`` replaces in a command by the path of the serial port."""

C = TypeVar("C", CubeStar, CubeSense)


class VirtualSerial:
    """A serial port with the part of pyserial's interface that drivers use, in virtual time.

    Attributes:
        timeout: longest wait for all bytes of a read, in s of virtual time; None waits for ever.
        port: a name for messages.
        baudrate: of the line.
    """

    def __init__(self, line: DirectSerial, baudrate: int, timeout: float | None = None) -> None:
        """Plug in."""
        self._line = line
        self._ahead = bytearray()
        self.timeout = timeout
        self.baudrate = baudrate
        self.port = self.name = "emulated"
        self.is_open = True

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived."""
        self._ahead += self._line.read(1 << 16, 0.0)
        return len(self._ahead)

    def read(self, size: int = 1) -> bytes:
        """Read ``size`` bytes, or what came within ``timeout``."""
        left_s = LONGEST_S if self.timeout is None else self.timeout
        while self.in_waiting < size:
            began_ps = self._line.now_ps
            piece = self._line.read(1 << 16, left_s)
            left_s -= (self._line.now_ps - began_ps) / PS_PER_S
            if not piece:
                break
            self._ahead += piece
        data = bytes(self._ahead[:size])
        del self._ahead[:size]
        return data

    def write(self, data: bytes) -> int:
        """Start sending."""
        self._line.write(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing is held back."""

    def reset_input_buffer(self) -> None:
        """Drop what has arrived."""
        if self.in_waiting:
            self._ahead.clear()

    def reset_output_buffer(self) -> None:
        """Nothing is held back."""

    def close(self) -> None:
        """Take the plug out."""
        self._line.close()
        self.is_open = False

    def __enter__(self) -> VirtualSerial:
        """Use it in a ``with`` block."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close."""
        self.close()


LONGEST_S = 3600.0
"""What "for ever" is: nothing of a device takes as long."""


class EmulatedDevice(Generic[C]):
    """A powered-up device.

    Attributes:
        board: the emulated board, with all its parts.
        faults: injects faults.
        seed: of everything random.
    """

    def __init__(self, board: Any, device: type[C], interface: Any, seed: int) -> None:
        """Take over ``board``."""
        self.board = board
        self.faults: Faults = board.faults
        self.seed = seed
        self._device: type[C] = device
        self._interface = interface
        self._client: C | None = None

    @property
    def client(self) -> C:
        """This project's client on the serial line; plugged in again after any other host."""
        if self._client is None:
            line = self.board.serial()
            self._client = self._device(NodeClient(line, self._interface))
        return self._client

    @property
    def time_s(self) -> float:
        """Virtual time since power-up."""
        return float(self.board.kernel.now / PS_PER_S)

    def wait(self, seconds: float) -> None:
        """Let virtual time pass."""
        self.board.kernel.advance_to(self.board.kernel.now + int(seconds * PS_PER_S))

    @property
    def scene(self) -> Any:
        """What the cameras see; a scene of the emulator, or the path of a scene file."""
        return self._looks_at.scene

    @scene.setter
    def scene(self, scene: Any) -> None:
        load = cubestar_scene if self._device is CubeStar else cubesense_scene
        self._looks_at.scene = _seen(scene, load)

    @property
    def _looks_at(self) -> Any:
        return self.board.camera if self._device is CubeStar else self.board

    # --- ports ----------------------------------------------------------------------------------

    def serial(self, timeout: float | None = 1.0) -> VirtualSerial:
        """The serial line with pyserial's interface."""
        self._client = None
        return VirtualSerial(self.board.serial(), self._interface.baud, timeout)

    def smbus(self) -> CubeSMBus:
        """The I2C bus with smbus2's interface."""
        return CubeSMBus(link=self.board.i2c())

    def run(
        self,
        *command: str | Path,
        timeout_s: float = 60.0,
        pace: Literal["real", "fast"] = "fast",
    ) -> subprocess.CompletedProcess[str]:
        """Run a program against the serial line; its exit code and output.

        Every "{port}" in ``command`` becomes the path of a pseudo-terminal. Raises
        subprocess.TimeoutExpired when it has not ended after ``timeout_s`` of wall time.
        """
        from cubestack.emulator.ports.endpoint import PtyEndpoint
        from cubestack.emulator.ports.realtime import RealtimeScheduler

        self._client = None
        with tempfile.TemporaryDirectory(prefix="cubestack-") as folder:
            port = Path(folder) / "tty"
            endpoint = PtyEndpoint(port, self.board.uart)
            try:
                pump = RealtimeScheduler(self.board.kernel, [endpoint], self.board.busy, pace=pace)
                words = [str(word).replace(PORT, str(port)) for word in command]
                program = subprocess.Popen(
                    words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
                )
                watch = _Watch(program, timeout_s, pump)
                pump.run()
                return watch.result()
            finally:
                endpoint.close()

    def run_on_i2c(self, *command: str | Path, bus: int = 7) -> int:
        """Run a program that finds the device on /dev/i2c-``bus``; its exit code."""
        from cubestack.emulator.i2cdev.adapter import I2cAdapter
        from cubestack.emulator.i2cdev.running import emulated_bus, run_program

        adapter = I2cAdapter(self.board.kernel, self.board.i2c_bus)
        with tempfile.TemporaryDirectory(prefix="cubestack-") as folder:
            path = Path(folder) / "bus"
            opened = emulated_bus(self.board.kernel, self.board.busy, adapter, path)
            try:
                return run_program([str(word) for word in command], bus, opened, pace="fast")
            finally:
                opened.port.close()

    def close(self) -> None:
        """Power down."""
        self.board.close()


class _Watch:
    """Waits for a program in a thread of its own, and ends the pump after it."""

    def __init__(self, program: subprocess.Popen[str], timeout_s: float, pump: Any) -> None:
        self._program = program
        self._timeout_s = timeout_s
        self._pump = pump
        self._outcome: subprocess.CompletedProcess[str] | Exception | None = None
        self._thread = threading.Thread(target=self._wait, daemon=True)
        self._thread.start()

    def _wait(self) -> None:
        program = self._program
        try:
            output, errors = program.communicate(timeout=self._timeout_s)
            words: Sequence[Any] = program.args  # type: ignore[assignment]
            self._outcome = subprocess.CompletedProcess(words, program.returncode, output, errors)
        except subprocess.TimeoutExpired as error:
            with program:  # closes the pipes unread, as a child of it may hold them for ever
                program.kill()
            self._outcome = error
        finally:
            self._pump.stop()

    def result(self) -> subprocess.CompletedProcess[str]:
        """What became of it."""
        self._thread.join()
        if isinstance(self._outcome, Exception):
            raise self._outcome
        assert self._outcome is not None
        return self._outcome


def _seen(scene: Any, load: Callable[[Path | None], Any]) -> Any:
    """``scene``, which may be the path of one; None is the default."""
    if scene is None:
        return load(None)
    return load(Path(scene)) if isinstance(scene, str | Path) else scene


def open_cubestar_device(
    scene: str | Path | Any | None = None,
    *,
    seed: int = 0,
    engine: Engine = "auto",
    layout: str = Layout.COPIED.value,
) -> EmulatedDevice[CubeStar]:
    """Power up a CubeStar; without ``scene`` it looks at Orion.

    ``layout`` is the name of a memory layout.
    """
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue

    seen = _seen(scene, cubestar_scene)
    board = CubeStarBoard(
        seen, onboard_catalogue(), seed=seed, engine=engine, layout=Layout(layout)
    )
    return EmulatedDevice(board, CubeStar, CUBESTAR, seed)


def open_cubesense_device(
    scene: str | Path | Any | None = None, *, seed: int = 0, engine: Engine = "auto"
) -> EmulatedDevice[CubeSense]:
    """Power up a CubeSense; without ``scene`` both Sun and Earth are in view."""
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard

    board = CubeSenseBoard(_seen(scene, cubesense_scene), seed=seed, engine=engine)
    return EmulatedDevice(board, CubeSense, CUBESENSE, seed)
