"""Peripherals that the microcontrollers of several boards have."""

from dataclasses import dataclass

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.camera.common.star_sensor import StarSensor
from cubestack.emulator.sim.virtual_time import PS_PER_S, PS_PER_US
from cubestack.firmware_model.mcu.requests import CameraTransfer
from cubestack.firmware_model.node.hardware import NodeHardware


@dataclass(eq=False)
class NodePeripherals(NodeHardware):
    """Peripherals that every node's program uses; boards add their own in a subclass."""

    _board: Board

    def uart_send(self, data: bytes) -> None:
        self._board.uart.send(data)

    def uart_backlog(self) -> int:
        return self._board.uart.backlog

    def wake(self) -> None:
        self._board.processor.wake()

    def uptime_us(self) -> int:
        return self._board.kernel.now // PS_PER_US


@dataclass(frozen=True)
class I2cCameraBus:
    """A camera's separate control bus: 7-bit address of the camera, and bits per second."""

    camera: StarSensor
    address: int
    hz: int

    def transfer_ps(self, request: CameraTransfer) -> int:
        """Nine bits per byte, including addresses, and one bit per start and stop."""
        bytes_on_wire = 1 + len(request.data) + (1 + request.read if request.read else 0)
        starts_and_stop = 3 if request.read else 2
        return (9 * bytes_on_wire + starts_and_stop) * PS_PER_S // self.hz

    def transfer(self, request: CameraTransfer, now_ps: int) -> bytes | None:
        """Write, then read; None if not acknowledged."""
        if not self.camera.i2c_write(self.address, request.data, now_ps):
            return None
        return self.camera.i2c_read(self.address, request.read, now_ps)
