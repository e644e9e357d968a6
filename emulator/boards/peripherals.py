"""Peripherals of microcontrollers that several boards have."""

from typing import Protocol

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.sim.virtual_time import PS_PER_S, PS_PER_US
from cubestack.firmware_model.mcu.requests import CameraTransfer
from cubestack.firmware_model.node.hardware import NodeHardware


class NodePeripherals(NodeHardware):
    """What every node's program uses; a board's own class adds the rest."""

    def __init__(self, board: Board) -> None:
        """Be part of ``board``."""
        self._board = board

    def uart_send(self, data: bytes) -> None:
        """Queue ``data`` for the satellite."""
        self._board.uart.send(data)

    def uart_backlog(self) -> int:
        """Bytes that the satellite's UART still has to send."""
        return self._board.uart.backlog

    def wake(self) -> None:
        """End the program's sleep."""
        self._board.processor.wake()

    def uptime_us(self) -> int:
        """Time since power-up in us."""
        return self._board.kernel.now // PS_PER_US


class I2cCamera(Protocol):
    """A camera with registers on an I2C bus."""

    def i2c_write(self, address: int, data: bytes, now_ps: int) -> bool:
        """A message to ``address`` ended; returns whether it was acknowledged."""

    def i2c_read(self, address: int, count: int, now_ps: int) -> bytes | None:
        """Read ``count`` bytes; None if not acknowledged."""


class I2cCameraBus:
    """A camera's control bus, which nobody else uses."""

    def __init__(self, camera: I2cCamera, address: int, hz: int) -> None:
        """Talk to ``camera`` at its 7-bit ``address`` with ``hz`` bits a second."""
        self._camera = camera
        self._address = address
        self._hz = hz

    def transfer_ps(self, request: CameraTransfer) -> int:
        """Nine bits a byte, addresses included, and a bit for each start and the stop."""
        bytes_on_wire = 1 + len(request.data) + (1 + request.read if request.read else 0)
        starts_and_stop = 3 if request.read else 2
        return (9 * bytes_on_wire + starts_and_stop) * PS_PER_S // self._hz

    def transfer(self, request: CameraTransfer, now_ps: int) -> bytes | None:
        """Write, then read; None when not acknowledged."""
        if not self._camera.i2c_write(self._address, request.data, now_ps):
            return None
        return self._camera.i2c_read(self._address, request.read, now_ps)
