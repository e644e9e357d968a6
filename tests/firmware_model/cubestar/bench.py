"""Runs the firmware program without an emulator: requests are performed at once, in bench time."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.costs import CORTEX_M3, Meter
from cubestack.firmware_model.cubestar.program import CubeStarProgram
from cubestack.firmware_model.hardware import (
    AwaitPin,
    CameraTransfer,
    FlashStore,
    ReadTimer,
    Request,
    Reset,
    SetPin,
    Sleep,
    StrobeRead,
)
from cubestack.firmware_model.interface.cubestar import INTERFACE, ResetCause
from cubestack.firmware_model.interface.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.star_catalogue import StarCatalogue

FRAME_US = 386_000


class Bench:
    """A program on fake hardware.

    Attributes:
        picture: what the FPGA delivers.
        camera_answers: whether the camera acknowledges.
        frame_arrives: whether ACK rises.
        pins: output pins.
        camera_writes: data of every write on the camera bus.
        on_request: called with every request before it is performed.
    """

    def __init__(self, catalogue: StarCatalogue) -> None:
        self.catalogue = catalogue
        self.external_ram = np.zeros(1 << 20, np.uint8)
        self.retention = bytearray(512)
        self.flash = FlashStore()
        self.reset_cause = int(ResetCause.POWER_ON)
        self.picture: NDArray[np.uint8] = np.zeros((512, 1024), np.uint8)
        self.camera_answers = True
        self.frame_arrives = True
        self.pins: dict[str, int] = {}
        self.camera_writes: list[bytes] = []
        self.currents = {"memory": 2.0, "imager": 50.0}
        self.switches = {"memory": True, "imager": True}
        self.resets: list[int] = []
        self.on_request: Callable[[Request], None] = lambda _request: None
        self.now_us = 0
        self._woken = False
        self._sent = bytearray()
        self._meter = Meter(CORTEX_M3)
        self._boot()
        self.run()

    # --- what the program uses ------------------------------------------------------------------

    def uart_send(self, data: bytes) -> None:
        self._sent += data

    def uart_backlog(self) -> int:
        return 0

    def wake(self) -> None:
        self._woken = True

    def switch_supply(self, channel: str, on: bool) -> None:
        self.switches[channel] = on

    def supply_current_ma(self, channel: str) -> float:
        return self.currents[channel] if self.switches[channel] else 0.0

    def uptime_ms(self) -> int:
        return self.now_us // 1000

    def temperature_c(self) -> float:
        return 21.5

    # --- what a test uses -----------------------------------------------------------------------

    def run(self, until_us: int | None = None) -> None:
        """Run until the program waits for the host, or until bench time ``until_us``."""
        while True:
            request = self._routine.send(self._answer)
            self.now_us += self._meter.take() * 1_000_000 // CORTEX_M3.clock_hz
            self.on_request(request)
            if isinstance(request, Sleep) and request.deadline_us is None and not self._woken:
                self._answer = True  # when it goes on, it was woken
                return
            if isinstance(request, Reset):
                self.resets.append(request.cause)
                self.reset_cause = request.cause
                self._boot()
                continue
            self._answer = self._perform(request)
            if until_us is not None and self.now_us >= until_us:
                return

    def uart(self, data: bytes) -> list[bytes]:
        """Send raw bytes; payloads of the frames that come back at once."""
        for byte in data:
            self.program.link.uart_byte(byte)
        decoder, frames = FrameDecoder(1024), []
        for byte in self._sent:
            if decoder.feed(byte) is FrameEvent.FRAME:
                frames.append(decoder.payload)
        self._sent.clear()
        return frames

    def command(self, name: str, **values: object) -> int:
        """Send a telecommand and run it; its acknowledge's error byte."""
        message = INTERFACE.telecommand(name)
        (answer,) = self.uart(encode_frame(bytes([message.id]) + message.pack(**values)))
        self.run()
        return answer[0]

    def telemetry(self, name: str) -> dict[str, Any]:
        message = INTERFACE.telemetry(name)
        (answer,) = self.uart(encode_frame(bytes([message.id])))
        return dict(message.unpack(answer))

    def flags(self) -> set[str]:
        return {name for name, up in self.telemetry("ErrorFlags").items() if up}

    def _boot(self) -> None:
        self.program = CubeStarProgram(self, self._meter, self.catalogue)
        self._routine = self.program.main()
        self._answer: object = None

    def _perform(self, request: Request) -> object:
        match request:
            case ReadTimer():
                return self.now_us
            case SetPin(pin, level):
                self.pins[pin] = level
            case AwaitPin():
                self.now_us += FRAME_US if self.frame_arrives else request.timeout_us
                return self.frame_arrives
            case Sleep():
                return self._sleep(request)
            case StrobeRead():
                request.target[:] = self.picture.reshape(-1)
                self.now_us += len(request.target) * request.cycles // 48
            case CameraTransfer():
                if not self.camera_answers:
                    return None
                self.camera_writes.append(request.data)
                return bytes([0x5A]) * request.read
        return None

    def _sleep(self, request: Sleep) -> bool:
        if request.wakeable and self._woken:
            self._woken = False
            return True
        assert request.deadline_us is not None
        self.now_us = max(self.now_us, request.deadline_us)
        return False
