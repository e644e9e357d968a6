"""Runs the firmware program without an emulator, in bench time.

A request is performed as a whole; only a sleep can be left half-way, so that a test can do
something at any time of it. The FPGA, the camera's register file and the supplies are as simple as
the program can tell them apart.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.memory import EXTERNAL_RAM_BYTES, RETENTION_BYTES
from cubestack.firmware_model.cubestar.program import CubeStarProgram
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE, ResetCause, TaskStatus
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.flash_store import FlashStore
from cubestack.firmware_model.mcu.requests import (
    AwaitPin,
    CameraTransfer,
    Pay,
    ReadTimer,
    Request,
    Reset,
    SetPin,
    Sleep,
    StrobeRead,
)

FRAME_US = 386_000
BOOT_US = 3_000
HANG_US = 1_000_000_000  # no telecommand takes longer: a whole picture on the UART takes 91 s
UART_BYTE_US = 174
CAMERA_BYTE_US = 90


class Bench:
    """A program on fake hardware.

    Attributes:
        picture: what the FPGA delivers.
        camera_refuses: whether the camera leaves a message with these bytes unanswered.
        frame_us: from the FPGA's ENABLE to ACK; None: the frame never comes.
        pins: output pins.
        camera: the camera's registers by address, as far as they were written.
        camera_writes: data of every message on the camera bus.
        currents: what the channels draw when they are on, in mA.
        switches: state of the load switches.
        resets: causes of all resets.
        on_request: called with every request before it is performed.
        log: (time in us, request) of every request but those that only take time.
        now_us: bench time; the timer of the program.
    """

    def __init__(self, catalogue: StarCatalogue) -> None:
        self.catalogue = catalogue
        self.flash = FlashStore()
        self.picture: NDArray[np.uint8] = np.zeros((512, 1024), np.uint8)
        self.camera_refuses: Callable[[bytes], bool] = lambda _data: False
        self.frame_us: int | None = FRAME_US
        self.currents = {"memory": 2.0, "imager": 52.8}
        self.on_request: Callable[[Request], None] = lambda _request: None
        self.resets: list[int] = []
        self.log: list[tuple[int, Request]] = []
        self.camera_writes: list[bytes] = []
        self.power_on()

    def power_on(self) -> None:
        """Power up, or off and on again: only flash stays."""
        self.external_ram = np.full(EXTERNAL_RAM_BYTES, 0xA5, np.uint8)
        self.retention = bytearray(RETENTION_BYTES)
        self.reset_cause = int(ResetCause.POWER_ON)
        self.pins = {"ENABLE": 0, "RNW": 0, "BANK": 0}
        self.camera: dict[int, int] = {}
        self.switches = {"memory": True, "imager": True}
        self.now_us = BOOT_US
        self.backlog = 0
        self._ack_us: int | None = None
        self._sent = bytearray()
        self._meter = Meter(CORTEX_M3)
        self._boot()
        self.run()

    # --- what the program uses ------------------------------------------------------------------

    def uart_send(self, data: bytes) -> None:
        self._sent += data

    def uart_backlog(self) -> int:
        return self.backlog

    def wake(self) -> None:
        self._woken = True

    def switch_supply(self, channel: str, on: bool) -> None:
        self.switches[channel] = on
        if not on and channel == "imager":
            self.camera.clear()
        if not on and channel == "memory":
            self.external_ram[:] = 0xA5

    def supply_current_ma(self, channel: str) -> float:
        return self.currents[channel] if self.switches[channel] else 0.0

    def uptime_us(self) -> int:
        return self.now_us

    def temperature_c(self) -> float:
        return 21.5

    # --- what a test uses -----------------------------------------------------------------------

    def run(self, until_us: int | None = None) -> None:
        """Run until bench time ``until_us``; without it, until the program waits for the host."""
        hang_us = self.now_us + HANG_US
        while until_us is None or self.now_us < until_us:
            assert self.now_us < hang_us, f"still busy: {self._request}"
            if self._request is None:
                self._request = self._routine.send(self._answer)
                self.now_us += self._meter.take() * 1_000_000 // CORTEX_M3.clock_hz
                self.on_request(self._request)
            if isinstance(self._request, Reset):
                self.resets.append(self._request.cause)
                self.reset_cause = self._request.cause
                self.now_us += BOOT_US
                self._boot()
                continue
            if isinstance(self._request, Sleep) and not self._slept(self._request, until_us):
                return
            if not isinstance(self._request, Sleep):
                self._answer = self._perform(self._request)
            self._request = None

    def uart(self, data: bytes) -> list[bytes]:
        """Send raw bytes; payloads of the frames that come back at once."""
        for byte in data:
            self.program.link.uart_byte(byte)
        return self.received()

    def never_stored(self) -> None:
        """ACK will not rise for the picture that the FPGA waits for."""
        self._ack_us = None

    def received(self) -> list[bytes]:
        """Payloads of the frames that came since the last call."""
        decoder, frames = FrameDecoder(1024), []
        for byte in self._sent:
            event = decoder.feed(byte)
            assert event in (None, FrameEvent.FRAME), f"the node sent {bytes(self._sent)!r}"
            if event is FrameEvent.FRAME:
                frames.append(decoder.payload)
        assert not decoder.unfinished
        self._sent.clear()
        return frames

    def send(self, name: str, **values: object) -> int:
        """Send a telecommand and do not run it; its acknowledge's error byte."""
        message = INTERFACE.telecommand(name)
        values = {**message.reset_values(), **values}
        (answer,) = self.uart(encode_frame(bytes([message.id]) + message.pack(**values)))
        (error,) = answer
        return error

    def command(self, name: str, **values: object) -> None:
        """Send a telecommand, which must be accepted, and run it to its end."""
        assert self.send(name, **values) == 0
        self.run()

    def telemetry(self, name: str) -> dict[str, Any]:
        message = INTERFACE.telemetry(name)
        (answer,) = self.uart(encode_frame(bytes([message.id])))
        return dict(message.unpack(answer))

    def status(self) -> TaskStatus:
        return TaskStatus(self.telemetry("TaskStatus")["taskStatus"])

    def start_loop(self, seconds: float) -> int:
        """Trigger the 1 Hz loop and run it so long; the time at which it was triggered."""
        start_us = self.now_us
        assert self.send("Trigger") == 0
        self.run(until_us=start_us + round(seconds * 1e6))
        return start_us

    def stored_us(self) -> list[int]:
        """When the FPGA was enabled to store a picture, since the log was cleared."""
        times, rnw = [], 0
        for now_us, request in self.log:
            if isinstance(request, SetPin) and request.pin == "RNW":
                rnw = request.level
            if request == SetPin("ENABLE", 1) and not rnw:
                times.append(now_us)
        return times

    def flags(self) -> set[str]:
        return {name for name, up in self.telemetry("ErrorFlags").items() if up}

    def i2c_write(self, data: bytes) -> int:
        """A write transfer; how many bytes were acknowledged before the first that was not."""
        count = self._i2c_bytes(data)
        self.program.link.i2c_stop()
        return count

    def i2c_read(self, count: int, identifier: int | None = None) -> bytes:
        """A read transfer, with a write of ``identifier`` and a repeated start before if given."""
        link = self.program.link
        if identifier is not None:
            assert self._i2c_bytes(bytes([identifier])) == 1
        link.i2c_start(True)
        data = bytes(link.i2c_read() for _ in range(count))
        link.i2c_stop()
        return data

    def _i2c_bytes(self, data: bytes) -> int:
        self.program.link.i2c_start(False)
        for count, byte in enumerate(data):
            if not self.program.link.i2c_write(byte):
                return count
        return len(data)

    def _boot(self) -> None:
        self._woken = False
        self._request: Request | None = None
        self._answer: object = None
        self.program = CubeStarProgram(self, self._meter, self.catalogue)
        self._routine = self.program.main()

    def _perform(self, request: Request) -> object:
        if not isinstance(request, Pay | ReadTimer):
            self.log.append((self.now_us, request))
        match request:
            case ReadTimer():
                return self.now_us
            case SetPin():
                self._set_pin(request.pin, request.level)
            case AwaitPin():
                assert request.pin == "ACK"
                deadline_us = self.now_us + request.timeout_us
                stored = self._ack_us is not None and self._ack_us <= deadline_us
                self.now_us = max(self.now_us, self._ack_us or 0) if stored else deadline_us
                return stored
            case StrobeRead():
                assert (self.pins["ENABLE"], self.pins["RNW"]) == (1, 1)
                request.target[:] = self.picture.reshape(-1)
                self.now_us += len(request.target) * request.cycles // 48
            case CameraTransfer():
                return self._camera_transfer(request)
        return None

    def _set_pin(self, pin: str, level: int) -> None:
        if pin != "ENABLE":
            assert not self.pins["ENABLE"], f"{pin} changes while the FPGA is enabled"
        self.pins[pin] = level
        if pin == "ENABLE":
            storing = level and not self.pins["RNW"] and self.switches["imager"]
            never = not storing or self.frame_us is None
            self._ack_us = None if never else self.now_us + (self.frame_us or 0)

    def _camera_transfer(self, request: CameraTransfer) -> bytes | None:
        self.now_us += CAMERA_BYTE_US * (len(request.data) + request.read)
        if not self.switches["imager"] or self.camera_refuses(request.data):
            return None
        self.camera_writes.append(request.data)
        address = int.from_bytes(request.data[:2], "big")
        for offset, byte in enumerate(request.data[2:]):
            self.camera[address + offset] = byte
        return bytes(self.camera.get(address + offset, 0) for offset in range(request.read))

    def camera_value(self, register: str) -> int:
        """What a register of the camera holds."""
        addresses = REGISTERS[register].addresses
        return int.from_bytes(bytes(self.camera[address] for address in addresses), "big")

    def _slept(self, request: Sleep, until_us: int | None) -> bool:
        """Sleep as far as it goes; False when something else has to happen first."""
        woken = request.wakeable and self._woken
        deadline_us = self.now_us if woken else request.deadline_us
        if deadline_us is None or (until_us is not None and deadline_us > until_us):
            self.now_us = self.now_us if until_us is None else until_us
            return False
        self.now_us = max(self.now_us, deadline_us)
        self._woken = self._woken and not woken
        self._answer = woken
        return True
