"""The program's host side on fake peripherals: links, telemetry, commands, streams.

Pictures, supplies and measurements are as simple as these can tell them apart. Nothing runs until
a test says so.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.commands import Commands
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.jobs import JobQueue
from cubestack.firmware_model.cubesense.links.bench import BenchLink
from cubestack.firmware_model.cubesense.links.node import NodeLink
from cubestack.firmware_model.cubesense.links.registers import RegisterLink
from cubestack.firmware_model.cubesense.state import CameraResult, State
from cubestack.firmware_model.cubesense.telemetry import Telemetry
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, pins
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20
from cubestack.firmware_model.mcu.requests import Pay, Routine

from ..host_side import HostSide, write_bytes
from ..runner import Runner

BENCH_BYTE_US = 87


class Links(Runner, HostSide):
    """Everything between the pins of the buses and the main loop."""

    interface = INTERFACE

    def __init__(self, *, mcu_addressing: bool = False) -> None:
        HostSide.__init__(self)
        Runner.__init__(self, PIC18F45K20)
        #: what each memory holds, (2, 307200)
        self.pictures: NDArray[np.uint8] = np.zeros((2, codes.IMAGE_BYTES), np.uint8)
        self.off: set[codes.Sram] = set()  #: memories without supply
        #: done: what the program did beside reading: measurements, restarts, cleared flags
        self.done: list[tuple[object, ...]] = []
        self.opened: list[codes.Sram] = []  #: memories whose pictures were begun, in order
        #: read, skipped: bytes read and passed over
        self.read = self.skipped = 0
        #: capture result of the next measurements
        self.outcome = codes.CaptureResult.STORED_OWN_SRAM
        self.bench_sent = bytearray()  #: bytes that the bench protocol's port got
        self._free_us = 0
        self.woken = 0
        self.amps = {monitor: 1.5 + index for index, monitor in enumerate(pins.Monitor)}
        self.mcu_addressing = mcu_addressing
        self.serial_number = "CS0042"
        self._open: codes.Sram | None = None
        self._position = 0

        self.state = State()
        self.queue = JobQueue()
        meter, state, queue = self.meter, self.state, self.queue
        self.commands = Commands(
            meter, state, supply=self, cameras=self, acquisition=self, measurement=self
        )
        reader, download = self.commands.reader, self.commands.download
        self.link = NodeLink(queue, Telemetry(self, meter, state, self, download))
        self.registers = RegisterLink(self, meter, state, queue, reader)
        self.bench = BenchLink(self, meter, state, queue, reader, measurement=self)

    # --- hardware -------------------------------------------------------------------------------

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        if port is Port.NODE:
            super().uart_send(data)
        else:
            self.bench_sent += data
            self._free_us = max(self._free_us, self.now_us) + BENCH_BYTE_US * len(data)

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        if port is Port.NODE:
            return self.backlog
        return max(0, -(-(self._free_us - self.now_us) // BENCH_BYTE_US))

    def wake(self) -> None:
        self.woken += 1

    def adc_counts(self, monitor: pins.Monitor) -> int:
        raise AssertionError("must be requested through the supply")

    # --- supply, cameras, acquisition, measurement ------------------------------------------------

    def currents(self) -> dict[pins.Monitor, float]:
        return self.amps

    def clear_over_current(self, *memories: codes.Sram) -> Routine[None]:
        self.done.append(("clear", *memories))
        yield Pay()

    def restart(self) -> Routine[None]:
        self.done.append(("restart",))
        yield Pay()

    @property
    def image_open(self) -> bool:
        return self._open is not None and self._open not in self.off

    def open_image(self, sram: codes.Sram) -> Routine[bool]:
        self.opened.append(sram)
        yield Pay()
        self._open, self._position = sram, 0
        return sram not in self.off

    def read_bytes(self, target: NDArray[np.uint8]) -> Routine[None]:
        yield Pay()
        assert self._open is not None
        end = self._position + len(target)
        assert end <= codes.IMAGE_BYTES
        if self.image_open:
            target[:] = self.pictures[self._open, self._position : end]
        self._position = end
        self.read += len(target)

    def skip_bytes(self, count: int) -> Routine[None]:
        yield Pay()
        self._position += count
        self.skipped += count

    def measure(
        self, camera: codes.Camera, sram: codes.Sram, *, detect: bool = True
    ) -> Routine[None]:
        self._open = None
        self.done.append(("measure", camera, sram, detect))
        detected = codes.DetectResult.SUCCESS if detect else codes.DetectResult.NONE_SCHEDULED
        yield Pay()
        self.state.results[camera] = CameraResult(self.outcome, detected, 1234, -567, sram=sram)

    # --- main loop --------------------------------------------------------------------------------

    def run(self, jobs: int | None = None) -> int | None:
        """Execute all waiting jobs, or ``jobs`` of them; returns the cause of a requested reset."""
        while self.queue and jobs != 0:
            jobs = None if jobs is None else jobs - 1
            cause = self.perform(self.commands.execute(self.queue.pop()))
            if cause is not None:
                return cause
        return None

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
        for byte in data:
            self.bench.uart_byte(byte)
        self.run()
        answer = bytes(self.bench_sent)
        self.bench_sent.clear()
        return answer
