"""The program's host side on fake peripherals: links, telemetry, commands, streams.

Pictures, supplies and measurements are as simple as these can tell them apart. Nothing runs until
a test says so.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.camera_control import CameraControl
from cubestack.firmware_model.cubesense.commands import Commands
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.jobs import JobQueue
from cubestack.firmware_model.cubesense.links.bench import BenchLink
from cubestack.firmware_model.cubesense.links.node import NodeLink
from cubestack.firmware_model.cubesense.links.registers import RegisterLink
from cubestack.firmware_model.cubesense.measurement import Measurement
from cubestack.firmware_model.cubesense.state import Result, State
from cubestack.firmware_model.cubesense.supply import Supply
from cubestack.firmware_model.cubesense.telemetry import Telemetry
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import (
    IMAGE_BYTES,
    Camera,
    CaptureResult,
    DetectResult,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.pins import Monitor
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Request, Routine, Sleep

BENCH_BYTE_US = 87


class Node:
    """Everything between the pins of the buses and the main loop.

    Attributes:
        pictures: what each memory holds, (2, 307200).
        off: memories without supply.
        log: what the program did beside reading: measurements, restarts, cleared flags.
        opened: memories whose pictures were begun, in order.
        read, skipped: bytes read and passed over.
        outcome: capture result of the next measurements.
        backlog: bytes that the node protocol's UART still has to send.
        on_request: called before each request is performed.
        now_us: bench time.
    """

    def __init__(self, *, mcu_addressing: bool = False) -> None:
        self.pictures: NDArray[np.uint8] = np.zeros((2, IMAGE_BYTES), np.uint8)
        self.off: set[Sram] = set()
        self.log: list[tuple[object, ...]] = []
        self.opened: list[Sram] = []
        self.read = self.skipped = 0
        self.outcome = CaptureResult.STORED_OWN_SRAM
        self.on_request: Callable[[Request], object] = lambda _request: None
        self.now_us = 0
        self.sent = {port: bytearray() for port in Port}
        self.backlog = 0
        self._free_us = 0
        self.woken = 0
        self.amps = {monitor: 1.5 + index for index, monitor in enumerate(Monitor)}
        self.mcu_addressing = mcu_addressing
        self.serial_number = "CS0042"
        self._open: Sram | None = None
        self._position = 0

        self.meter = Meter(PIC18F45K20)
        self.state = State()
        self.queue = JobQueue()
        self.commands = Commands(
            self,
            self.meter,
            self.state,
            cast(Supply, self),
            cast(CameraControl, self),
            cast(Acquisition, self),
            cast(Measurement, self),
        )
        reader, download = self.commands.reader, self.commands.download
        telemetry = Telemetry(self, self.meter, self.state, cast(Supply, self), download)
        self.link = NodeLink(self, self.meter, self.state, self.queue, telemetry, download)
        self.registers = RegisterLink(self, self.meter, self.state, self.queue, reader)
        self.bench = BenchLink(
            self, self.meter, self.state, self.queue, reader, cast(Measurement, self)
        )

    # --- hardware -------------------------------------------------------------------------------

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        self.sent[port] += data
        if port is Port.BENCH:
            self._free_us = max(self._free_us, self.now_us) + BENCH_BYTE_US * len(data)

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        if port is Port.NODE:
            return self.backlog
        return max(0, -(-(self._free_us - self.now_us) // BENCH_BYTE_US))

    def wake(self) -> None:
        self.woken += 1

    def adc_counts(self, monitor: Monitor) -> int:
        raise AssertionError("asked for through the supply")

    def uptime_us(self) -> int:
        return self.now_us

    # --- supply, cameras, acquisition, measurement ------------------------------------------------

    def currents(self) -> dict[Monitor, float]:
        return self.amps

    def clear_over_current(self, *memories: Sram) -> Routine[None]:
        self.log.append(("clear", *memories))
        yield Pay()

    def restart(self) -> Routine[None]:
        self.log.append(("restart",))
        yield Pay()

    @property
    def picture_open(self) -> bool:
        return self._open is not None and self._open not in self.off

    def open_picture(self, sram: Sram) -> Routine[bool]:
        self.opened.append(sram)
        yield Pay()
        self._open, self._position = sram, 0
        return sram not in self.off

    def read_bytes(self, target: NDArray[np.uint8]) -> Routine[None]:
        yield Pay()
        assert self._open is not None
        end = self._position + len(target)
        assert end <= IMAGE_BYTES
        if self.picture_open:
            target[:] = self.pictures[self._open, self._position : end]
        self._position = end
        self.read += len(target)

    def skip_bytes(self, count: int) -> Routine[None]:
        yield Pay()
        self._position += count
        self.skipped += count

    def measure(self, camera: Camera, sram: Sram, *, detect: bool = True) -> Routine[None]:
        self._open = None
        self.log.append(("measure", camera, sram, detect))
        detected = DetectResult.SUCCESS if detect else DetectResult.NONE_SCHEDULED
        yield Pay()
        self.state.results[camera] = Result(self.outcome, detected, 1234, -567, sram=sram)

    # --- main loop --------------------------------------------------------------------------------

    def run(self, jobs: int | None = None) -> int | None:
        """Execute what waits, or so many jobs of it; the cause of a reset, if one was asked for."""
        while self.queue and jobs != 0:
            jobs = None if jobs is None else jobs - 1
            routine, answer = self.commands.execute(self.queue.pop()), None
            while True:
                try:
                    request = routine.send(answer)
                except StopIteration as end:
                    if end.value is not None:
                        return int(end.value)
                    break
                self.on_request(request)
                answer = self._perform(request)
        return None

    def _perform(self, request: Request) -> Any:
        match request:
            case ReadTimer():
                return self.now_us
            case Sleep():
                assert request.deadline_us is not None
                self.now_us = max(self.now_us, request.deadline_us)
        return None

    # --- node protocol ----------------------------------------------------------------------------

    def uart(self, data: bytes) -> bytes:
        """Send raw bytes; the bytes that come back at once."""
        for byte in data:
            self.link.uart_byte(byte)
        answer = bytes(self.sent[Port.NODE])
        self.sent[Port.NODE].clear()
        return answer

    def frames(self, payload: bytes) -> list[bytes]:
        """Send a frame; payloads of the frames that come back at once."""
        decoder, found = FrameDecoder(1024), []
        for byte in self.uart(encode_frame(payload)):
            if decoder.feed(byte) is FrameEvent.FRAME:
                found.append(decoder.payload)
        assert not decoder.unfinished
        return found

    def send(self, name: str, **values: object) -> int:
        """Send a telecommand, others than ``values`` as after a reset; its error byte."""
        message = INTERFACE.telecommand(name)
        (answer,) = self.frames(
            bytes([message.id]) + message.pack(**{**message.reset_values(), **values})
        )
        (error,) = answer
        return error

    def command(self, name: str, **values: object) -> None:
        """Send a telecommand, which must be accepted, and execute it."""
        assert self.send(name, **values) == 0
        self.run()

    def telemetry(self, name: str) -> dict[str, Any]:
        message = INTERFACE.telemetry(name)
        (answer,) = self.frames(bytes([message.id]))
        return dict(message.unpack(answer))

    def i2c_write(self, data: bytes) -> int:
        """A write transfer; how many bytes were acknowledged before the first that was not."""
        count = write_bytes(self.link, data)
        self.link.i2c_stop()
        return count

    def i2c_read(self, count: int, identifier: int | None = None) -> bytes:
        """A read transfer, with a write of ``identifier`` and a repeated start before if given."""
        if identifier is not None:
            assert write_bytes(self.link, bytes([identifier])) == 1
        self.link.i2c_start(True)
        data = [self.link.i2c_read() for _ in range(count)]
        self.link.i2c_stop()
        return bytes(byte for byte in data if byte is not None)

    # --- register protocol ------------------------------------------------------------------------

    def write_register(self, *data: int) -> int:
        """A write transfer to the pointer's address; how many bytes were acknowledged."""
        count = write_bytes(self.registers, bytes(data))
        self.registers.i2c_stop()
        return count

    def read_register(self, count: int, address: int | None = None) -> bytes:
        """Read on, or a register from its beginning; the program runs while the clock is low."""
        if address is not None:
            assert write_bytes(self.registers, bytes([address])) == 1
        self.registers.i2c_start(True)
        data = bytearray()
        while len(data) < count:
            byte = self.registers.i2c_read()
            if byte is None:
                assert self.queue, "the clock is stretched for ever"
                self.run(1)
            else:
                data.append(byte)
        self.registers.i2c_stop()
        return bytes(data)

    # --- bench protocol ---------------------------------------------------------------------------

    def letters(self, data: bytes) -> bytes:
        """Send letters, run, and return what the bench computer got."""
        for byte in data:
            self.bench.uart_byte(byte)
        self.run()
        answer = bytes(self.sent[Port.BENCH])
        self.sent[Port.BENCH].clear()
        return answer


def write_bytes(link: NodeLink | RegisterLink, data: bytes) -> int:
    """Start a write transfer; how many bytes were acknowledged before the first that was not."""
    link.i2c_start(False)
    for count, byte in enumerate(data):
        if not link.i2c_write(byte):
            return count
    return len(data)
