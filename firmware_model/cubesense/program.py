"""CubeSense's main program: executes the links' requests, one job after the other.

CubeSense thesis, section 6.4: the satellite's computer requests an image and its measurement;
nothing runs by itself. While there is no request, the program monitors the memories' currents.
"""

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.camera_control import CameraControl
from cubestack.firmware_model.cubesense.commands import Commands
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware, Port
from cubestack.firmware_model.cubesense.jobs import JobQueue
from cubestack.firmware_model.cubesense.links.backup_uart import BackupUart
from cubestack.firmware_model.cubesense.links.bench import BenchLink
from cubestack.firmware_model.cubesense.links.node import NodeLink
from cubestack.firmware_model.cubesense.links.registers import RegisterLink
from cubestack.firmware_model.cubesense.measurement import Measurement
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.cubesense.supply import Supply
from cubestack.firmware_model.cubesense.telemetry import Telemetry
from cubestack.firmware_model.interface.cubesense.fpga import READ_OUTS
from cubestack.firmware_model.interface.cubesense.switches import (
    DEFAULT_SWITCHES,
    CubeSenseSwitches,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Reset, Routine

#: Longest wait of a reset for the UART, whose longest answer takes half of it: assumed.
DRAIN_US = 100_000
DRAIN_STEP_US = 1_000


class CubeSenseProgram:
    """One run of the program, from reset to reset."""

    def __init__(
        self,
        hardware: CubeSenseHardware,
        meter: Meter,
        switches: CubeSenseSwitches = DEFAULT_SWITCHES,
    ) -> None:
        self.idle = False  #: no job waits
        self._hardware = hardware
        self.state = state = State(switches)  #: state: the program's memory, also read by traces
        self._supply = Supply(hardware, meter, state)
        self.cameras = CameraControl(meter, state, self._supply)
        read_out = READ_OUTS[switches.gateware]
        self.acquisition = acquisition = Acquisition(hardware, meter, self._supply, read_out)
        measurement = Measurement(meter, state, self.cameras, acquisition)
        self._jobs = jobs = JobQueue()
        self.commands = Commands(meter, state, self._supply, self.cameras, acquisition, measurement)
        reader, download = self.commands.reader, self.commands.download
        #: the node protocol; its methods are the interrupts of its UART and I2C address
        self.node = NodeLink(jobs, Telemetry(hardware, meter, state, self._supply, download))
        #: the register protocol; likewise, for its I2C address
        self.registers = RegisterLink(hardware, meter, state, jobs, reader)
        #: the register protocol on the node's UART, where that is chosen
        self.backup = BackupUart(self.registers)
        #: the bench protocol; likewise, for its UART
        self.bench = BenchLink(hardware, meter, state, jobs, reader, measurement)

    def main(self) -> Routine[None]:
        yield from self._supply.start()
        yield from self.cameras.start()
        while True:
            self.idle = not self._jobs
            if self.idle:
                yield from self._supply.idle()
                continue
            yield from self._supply.sample()
            cause = yield from self.commands.execute(self._jobs.pop())
            if cause is not None:
                yield from self._drain()
                yield Reset(cause)

    def _drain(self) -> Routine[None]:
        """Let the UART send the pending answers, in particular the acknowledge of the reset."""
        now_us: int = yield ReadTimer()
        deadline_us = now_us + DRAIN_US
        while self._hardware.uart_backlog(Port.NODE) and now_us < deadline_us:
            yield from self._supply.watch_until(now_us + DRAIN_STEP_US)
            now_us = yield ReadTimer()
