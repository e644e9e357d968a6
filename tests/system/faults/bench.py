"""A powered device with a client and access to both ends of its lines."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import pytest
from smbus2 import i2c_msg

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.boards.contract import Board
from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.faults.injection import Injection
from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, DetectResult
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubestar.codes import ImageBlockSize
from cubestack.host.clients.aramis.client import Attitude
from cubestack.host.clients.cubesense.client import Measurement
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.emulation.emulated import AnyEmulated, power_up
from tests.system.conftest import Ear
from tests.system.cubesense.conftest import FACING, check_right, held

ORION_DEG = (84.0, -1.0)


class Wire(Ear):
    """A watched serial line between host and device."""

    def __init__(self, line: Any, uart: Uart) -> None:
        super().__init__(uart)
        self._line = line

    def ask(self, payload: bytes, timeout_s: float = 0.1) -> bytes:
        """Sends ``payload`` in a frame; returns all bytes until the line is silent."""
        self.sent.clear()
        self.heard.clear()
        self._line.write(encode_frame(payload))
        return b"".join(iter(lambda: self._line.read(1000, timeout_s), b""))

    @property
    def answered(self) -> bytes:
        return b"".join(data for data, _, _ in self.sent)

    @property
    def asked(self) -> bytes:
        return bytes(byte for byte, _ in self.heard)


class Spy:
    """A watched target on an I2C bus.

    Attributes:
        seen: "S w" or "S r" for a start, bytes in hexadecimal, "P" for a stop.
    """

    def __init__(self, target: Any) -> None:
        self._target = target
        self.i2c_read = target.i2c_read
        self.seen: list[str] = []

    def i2c_start(self, read: bool) -> None:
        self.seen.append("S r" if read else "S w")
        self._target.i2c_start(read)

    def i2c_write(self, byte: int) -> bool:
        self.seen.append(f"{byte:02x}")
        return bool(self._target.i2c_write(byte))

    def i2c_stop(self) -> None:
        self.seen.append("P")
        self._target.i2c_stop()


class Bench:
    """One device with a client on its serial line; ``flags_in`` is telemetry with error flags."""

    scene: ClassVar[Any]
    flags_in = "ErrorFlags"

    def __init__(self, opened: AnyEmulated) -> None:
        self.name = opened.device.name
        self.board: Board = opened.board
        self.faults = opened.faults
        self.interface = opened.device.interface
        self.byte_s = 10 / self.interface.baud
        self.device: Any = opened.client

    @property
    def client(self) -> NodeClient:
        found: NodeClient = self.device.client
        return found

    @property
    def now_s(self) -> float:
        return float(self.board.kernel.now / PS_PER_S)

    def wire(self) -> Wire:
        """Replaces the client by a bare line."""
        return Wire(self.board.serial(), self.board.uart)

    def plug_in(self, *, timeout_s: float = 0.1, retries: int = 0) -> NodeClient:
        """Replaces the client by one with a shorter time-out."""
        line = self.board.serial()
        self.device.client = NodeClient(line, self.interface, timeout_s=timeout_s, retries=retries)
        return self.client

    def spy(self) -> Spy:

        bus, address = self.board.i2c_bus, self.interface.i2c_address
        spy = bus._targets[address] = Spy(bus.targets[address])
        return spy

    def ask_i2c(self) -> bytes:
        """Telemetry Identification over I2C, without the client."""
        message, address = self.interface.telemetry("Identification"), self.interface.i2c_address
        answer = i2c_msg.read(address, message.length)
        self.board.i2c().i2c_rdwr(i2c_msg.write(address, [message.id]), answer)
        return bytes(answer)

    def inject(self, kind: str, *, after_s: float = 0.0, **options: Any) -> Injection:

        at_s = self.now_s + after_s if after_s else None
        injection: Injection = self.faults.inject(kind, at_s=at_s, **options)
        return injection

    def during(self, kind: str, act: Callable[[], Any], **options: Any) -> Any:
        """The result of ``act`` during a fault, which is then cleared."""
        self.inject(kind, **options)
        result = act()
        self.faults.clear()
        return result

    def said(self) -> list[str]:
        return [str(event).split(": ", 1)[1] for event in self.faults.log]

    def telemetry(self, name: str) -> dict[str, Any]:
        return dict(self.client.telemetry(name))

    def flags(self) -> set[str]:
        """Set error flags, except those caused by the sky of these tests."""
        values = self.telemetry(self.flags_in)
        up = {flag for flag, up in values.items() if up and not flag.endswith("Count")}
        return up - {"MaxStarsDetection"}


STORING_S, READING_S = 0.42, 0.6
"""Times within CubeStar's first capture after power-up, which stores one frame."""

ONE_FRAME_MS, TWO_FRAMES_MS = 384.0, 770.0
"""Store times of a first capture that keeps the first or the second whole frame."""

GOOD = ("CALCULATED", set[str]())  # task status and error flags after a capture
FAILED = ("CAPTURE_FAILED", {"ImageCaptureError"})


class Star(Bench):
    board: CubeStarBoard
    scene = replace(SkyScene.pointing(*ORION_DEG), mag_limit=3.8)

    @property
    def stored(self) -> np.ndarray:
        """The FPGA's memory, (512, 1024)."""
        memory: np.ndarray = self.board.engine.sram[: 512 * 1024]
        return memory.reshape(512, 1024).copy()

    @property
    def transferred(self) -> np.ndarray:
        """The picture in the processor's memory, (512, 1024)."""
        memory: np.ndarray = self.board.program._capture.memory.image
        return memory.copy()

    @property
    def stored_for_ms(self) -> float:
        """Store time of the latest capture."""
        return float(self.device.phase_times()["capture"])

    def block(self, number: int) -> np.ndarray:
        """128 bytes of the picture, as downloaded by the host."""
        size = ImageBlockSize.BYTES_128
        self.client.command("ImageBlockSet", BlockNumber=number, BlockSize=size)
        self.client.wait_processed(1.0)
        return np.frombuffer(self.telemetry("ImageBlock")["Block"], np.uint8)

    def measure(self) -> str:
        return str(self.device.capture_and_process().name)

    def capture(self) -> tuple[str, set[str]]:
        return self.measure(), self.flags()

    def capture_with(self, kind: str, **options: Any) -> tuple[str, set[str]]:

        status, flags = self.during(kind, self.capture, **options)
        return status, flags


WAIT_S, REQUEST_S = 0.015, 0.003
"""Time from a request after ``await_frame`` to its frame, and its minimum: the bytes on the line
and the gap before a frame that the FPGA must see."""

TIMED_OUT = (CaptureResult.CAMERA_TIMEOUT, DetectResult.NONE_SCHEDULED)


class Sense(Bench):
    """A CubeSense; the default half is the nadir camera's."""

    board: CubeSenseBoard
    scene = FACING
    flags_in = "CommunicationStatus"

    def measure(self, camera: Camera = Camera.NADIR) -> Measurement:
        found: Measurement = self.device.capture_and_detect(camera)
        return found

    def measure_with(self, kind: str, **options: Any) -> Measurement:

        found: Measurement = self.during(kind, self.measure, **{"target": "nadir"} | options)
        return found

    def outcome(self, camera: Camera = Camera.NADIR) -> tuple[CaptureResult, DetectResult]:
        found = self.measure(camera)
        return found.capture, found.detect

    def check(self, camera: Camera = Camera.NADIR) -> None:
        check_right(self.measure(camera))

    def await_frame(self) -> RollingShutter:
        """Waits until the next frame is ``WAIT_S`` away; returns that frame."""
        kernel = self.board.kernel
        wanted_ps = kernel.now + round(WAIT_S * PS_PER_S)
        frame: RollingShutter = self.board.cameras[Camera.NADIR].frame_from(wanted_ps)
        self.client.pause((frame.readout_ps - kernel.now) / PS_PER_S - WAIT_S)
        assert frame.readout_ps - kernel.now > REQUEST_S * PS_PER_S
        return frame

    def picture(self, camera: Camera = Camera.NADIR) -> np.ndarray:
        """The memory of a camera's half, (480, 640)."""
        return held(self.board, camera)

    def host_pixel(self, x: int, y: int) -> int:
        size = codes.ImageSize.SIDE_1024
        column = x + (size.side - FULL_SIZE.columns) // 2
        row = y + (size.side - FULL_SIZE.rows) // 2
        frame, at = divmod(row * size.side + column, codes.FRAME_BYTES)
        top = {"Location": codes.ImageLocation.TOP, "Size": size}
        self.client.command("StartImageDownload", Sram=codes.Sram.SRAM2, **top)
        self.client.command("NextImageFrame", Frame=frame)
        for _ in range(50):
            self.client.pause(0.04)
            if self.telemetry("ImageFrameInfo")["FrameNumber"] == frame:
                return int(bytes(self.telemetry("ImageFrame")["Frame"])[at])
        pytest.fail(f"frame {frame} is never ready")


def line_s(frame: RollingShutter, line: float) -> float:
    """Virtual time at which a frame's line is read out."""
    return float(frame.readout_ps + line * frame.line_ps) / PS_PER_S


class Tracker(Bench):
    board: AramisBoard
    scene = SkyScene.pointing(*ORION_DEG, 20.0)

    def measure(self) -> Attitude:
        found: Attitude = self.device.measure()
        return found

    def check(self) -> None:
        found = self.measure()
        assert found.valid
        assert attitude_error_deg(found.quaternion, self.board.truth(found.frame))[0] < 0.01


@lru_cache(maxsize=1)
def small_catalogue() -> Database:
    """A catalogue that suffices for the sky of these tests."""
    return build_database(CatalogueParameters(step_deg=10, stars_per_field=5))


BENCHES: dict[str, type[Bench]] = {"cubestar": Star, "cubesense": Sense, "aramis": Tracker}


@contextmanager
def powered(name: str, profile: str = DEFAULT_PROFILE) -> Iterator[Any]:
    """Powers up a device with its scene."""
    lenses = {"set": "lens=nominal"} if name == "cubesense" else {}
    own = {"catalogue": small_catalogue()} if name == "aramis" else lenses
    scene = BENCHES[name].scene
    with power_up(device(name), scene, seed=4, profile=profile, **own) as opened:
        yield BENCHES[name](opened)
