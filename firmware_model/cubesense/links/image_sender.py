"""Sends an image over a UART, piece by piece, as the UART has room for it.

The program does other jobs between two pieces.
"""

from dataclasses import dataclass, field

from cubestack.firmware_model.cubesense.download import ImageReader
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware, Port
from cubestack.firmware_model.interface.cubesense import codes, service_port
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, Sleep

#: Bytes of an image that are read and queued at once, while at most as many are still queued.
CHUNK_BYTES = 24

_BYTE_US = -(-10 * 1_000_000 // service_port.SERVICE_PORT.baud)


@dataclass(eq=False)
class ImageSender:
    """Sends images on ``port``, one at a time."""

    hardware: CubeSenseHardware
    meter: Meter
    reader: ImageReader
    port: Port
    _sent: int = field(default=0, init=False)

    def begin(self) -> None:
        self._sent = 0

    def send_some(self, sram: codes.Sram) -> Routine[bool]:
        """Send as much as there is room for; True at the image's end, or if it cannot be read."""
        too_many = self.hardware.uart_backlog(self.port) - CHUNK_BYTES
        if too_many > 0:
            now_us: int = yield ReadTimer()
            yield Sleep(now_us + too_many * _BYTE_US)
            return False
        start = self._sent
        count = min(CHUNK_BYTES, codes.IMAGE_BYTES - start)
        data = yield from self.reader.read_run(sram, start, count)
        if data is None:
            return True
        if self._sent != start:  # restarted meanwhile
            return False
        self.send(data)
        self._sent += count
        return self._sent == codes.IMAGE_BYTES

    def send(self, data: bytes) -> None:
        self.meter.charge(uart_interrupt=len(data))
        self.hardware.uart_send(data, self.port)
