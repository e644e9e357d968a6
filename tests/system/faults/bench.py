"""A device on the bench: powered up, with a client, and with a look at both ends of its lines."""

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
    """A serial line between a host and a device's end, which is watched."""

    def __init__(self, line: Any, uart: Uart) -> None:
        super().__init__(uart)
        self._line = line

    def ask(self, payload: bytes, timeout_s: float = 0.1) -> bytes:
        """Send a frame with ``payload``; all bytes that come back before a silence."""
        self.sent.clear()
        self.heard.clear()
        self._line.write(encode_frame(payload))
        return b"".join(iter(lambda: self._line.read(1000, timeout_s), b""))

    @property
    def answered(self) -> bytes:
        """Bytes that the device sent."""
        return b"".join(data for data, _, _ in self.sent)

    @property
    def asked(self) -> bytes:
        """Bytes that the device received."""
        return bytes(byte for byte, _ in self.heard)


class Spy:
    """A target on an I2C bus that is watched.

    Attributes:
        seen: what it got: "S w" or "S r" for a start, bytes in hexadecimal, "P" for a stop.
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
    """One device with a client on its serial line.

    Attributes:
        scene: what it is made for.
        flags_in: telemetry with its error flags.
        board: the emulated board.
        faults: the board's.
        device: host's view.
    """

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
        """Plug a bare line in instead of the client."""
        return Wire(self.board.serial(), self.board.uart)

    def plug_in(self, *, timeout_s: float = 0.1, retries: int = 0) -> NodeClient:
        """A new client, which does not wait as long."""
        line = self.board.serial()
        self.device.client = NodeClient(line, self.interface, timeout_s=timeout_s, retries=retries)
        return self.client

    def spy(self) -> Spy:
        """Watch the node's end of the I2C bus."""
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
        """Inject a fault, ``after_s`` from now."""
        at_s = self.now_s + after_s if after_s else None
        injection: Injection = self.faults.inject(kind, at_s=at_s, **options)
        return injection

    def during(self, kind: str, act: Callable[[], Any], **options: Any) -> Any:
        """What ``act`` returns with a fault, which is cleared then."""
        self.inject(kind, **options)
        result = act()
        self.faults.clear()
        return result

    def said(self) -> list[str]:
        """What the faults did, without their times."""
        return [str(event).split(": ", 1)[1] for event in self.faults.log]

    def telemetry(self, name: str) -> dict[str, Any]:
        return dict(self.client.telemetry(name))

    def flags(self) -> set[str]:
        """Error flags that are up, but for those of the sky that these tests look at."""
        values = self.telemetry(self.flags_in)
        up = {flag for flag, up in values.items() if up and not flag.endswith("Count")}
        return up - {"MaxStarsDetection"}


STORING_S, READING_S = 0.42, 0.6
"""Within a CubeStar's first capture after power-up, which stores one frame."""

ONE_FRAME_MS, TWO_FRAMES_MS = 384.0, 770.0
"""How long a first capture stores, when the FPGA keeps the first whole frame, or the second."""

GOOD = ("CALCULATED", set[str]())
FAILED = ("CAPTURE_FAILED", {"ImageCaptureError"})
"""Of a capture: how far it and its processing came, and the flags."""


class Star(Bench):
    """A CubeStar."""

    board: CubeStarBoard
    scene = replace(SkyScene.pointing(*ORION_DEG), mag_limit=3.8)

    @property
    def stored(self) -> np.ndarray:
        """What the FPGA wrote into its memory, (512, 1024)."""
        memory: np.ndarray = self.board.engine.sram[: 512 * 1024]
        return memory.reshape(512, 1024).copy()

    @property
    def transferred(self) -> np.ndarray:
        """What the processor read of it, (512, 1024)."""
        memory: np.ndarray = self.board.program._capture.pictures.image
        return memory.copy()

    @property
    def stored_for_ms(self) -> float:
        """How long the FPGA stored in the latest capture."""
        return float(self.device.phase_times()["capture"])

    def block(self, number: int) -> np.ndarray:
        """128 bytes of the picture as the host gets them."""
        size = ImageBlockSize.BYTES_128
        self.client.command("ImageBlockSet", BlockNumber=number, BlockSize=size)
        self.client.wait_processed(1.0)
        return np.frombuffer(self.telemetry("ImageBlock")["Block"], np.uint8)

    def measure(self) -> str:
        """How far a capture and its processing came."""
        return str(self.device.capture_and_process().name)

    def capture(self) -> tuple[str, set[str]]:
        """The same, and the flags."""
        return self.measure(), self.flags()

    def capture_with(self, kind: str, **options: Any) -> tuple[str, set[str]]:
        """The same with a fault, which is cleared then."""
        status, flags = self.during(kind, self.capture, **options)
        return status, flags


WAIT_S, REQUEST_S = 0.015, 0.003
"""From a request made after ``await_frame`` to its frame; and what it takes at least: the bytes
on the line, and the gap before a frame that the FPGA has to see."""

TIMED_OUT = (CaptureResult.CAMERA_TIMEOUT, DetectResult.NONE_SCHEDULED)


class Sense(Bench):
    """A CubeSense; of its halves it is the nadir camera's if nothing else is said."""

    board: CubeSenseBoard
    scene = FACING
    flags_in = "CommunicationStatus"

    def measure(self, camera: Camera = Camera.NADIR) -> Measurement:
        found: Measurement = self.device.capture_and_detect(camera)
        return found

    def measure_with(self, kind: str, **options: Any) -> Measurement:
        """A measurement with a fault, which is cleared then."""
        found: Measurement = self.during(kind, self.measure, **{"target": "nadir"} | options)
        return found

    def outcome(self, camera: Camera = Camera.NADIR) -> tuple[CaptureResult, DetectResult]:
        """How far a measurement comes."""
        found = self.measure(camera)
        return found.capture, found.detect

    def check(self, camera: Camera = Camera.NADIR) -> None:
        """A measurement is right."""
        check_right(self.measure(camera))

    def await_frame(self) -> RollingShutter:
        """Wait until a request would wait for ``WAIT_S``; the frame that it would store."""
        kernel = self.board.kernel
        wanted_ps = kernel.now + round(WAIT_S * PS_PER_S)
        frame: RollingShutter = self.board.cameras[Camera.NADIR].frame_from(wanted_ps)
        self.client.pause((frame.readout_ps - kernel.now) / PS_PER_S - WAIT_S)
        assert frame.readout_ps - kernel.now > REQUEST_S * PS_PER_S
        return frame

    def picture(self, camera: Camera = Camera.NADIR) -> np.ndarray:
        """What the memory of a camera's half holds, (480, 640)."""
        return held(self.board, camera)

    def host_pixel(self, x: int, y: int) -> int:
        """A pixel as the host gets it."""
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
    """An AraMiS star tracker."""

    board: AramisBoard
    scene = SkyScene.pointing(*ORION_DEG, 20.0)

    def measure(self) -> Attitude:
        found: Attitude = self.device.measure()
        return found

    def check(self) -> None:
        """A measurement gives the truth's attitude."""
        found = self.measure()
        assert found.valid
        assert attitude_error_deg(found.quaternion, self.board.truth(found.frame))[0] < 0.01


@lru_cache(maxsize=1)
def small_catalogue() -> Database:
    """Stars and triangles of which the test's sky has enough."""
    return build_database(CatalogueParameters(step_deg=10, stars_per_field=5))


BENCHES: dict[str, type[Bench]] = {"cubestar": Star, "cubesense": Sense, "aramis": Tracker}


@contextmanager
def powered(name: str, profile: str = DEFAULT_PROFILE) -> Iterator[Any]:
    """A device that sees what it is made for."""
    lenses = {"set": "lens=nominal"} if name == "cubesense" else {}
    own = {"catalogue": small_catalogue()} if name == "aramis" else lenses
    scene = BENCHES[name].scene
    with power_up(device(name), scene, seed=4, profile=profile, **own) as opened:
        yield BENCHES[name](opened)
