"""Image transfer to a host: a reader that continues where it stopped, and frames of 128 bytes.

An FPGA presents an image in sequence, so `ImageReader` keeps it open between two reads. It skips
to pixels ahead; for pixels behind, and after another use of the FPGAs, it starts again. A download
in the order of its frames reads the image once.

CubeSpace family with two cameras, interface generation 2: telecommands 64 and 65 request a frame,
telemetry 65 reports when it is ready, 64 contains it. Assumed: while a frame is being prepared,
telemetry 64 has the current content of its buffer; a frame with a later request is not prepared.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware, Port
from cubestack.firmware_model.cubesense.jobs import FrameRequest
from cubestack.firmware_model.interface.cubesense import codes, service_port
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine, Sleep

#: Number of a pixel outside of the image.
OUTSIDE = -1

#: Bytes of an image that are read and queued at once, while at most as many are still queued.
CHUNK_BYTES = 24

_BYTE_US = -(-10 * 1_000_000 // service_port.SERVICE_PORT.baud)


def frame_pixels(size: codes.ImageSize, frame: int) -> NDArray[np.int32]:
    """Source of the 128 bytes of a frame, int32 (128,).

    Each is a pixel's number in the image, row by row from 0 to 307199, or ``OUTSIDE`` for a byte
    that is zero. Numbers ascend within a frame and from frame to frame. Assumed: the image lies in
    the middle of 1024 x 1024 pixels, and a smaller square takes every 2nd, 4th, 8th or 16th pixel
    of every such row, from the first on. The margins, 192 columns and 272 rows, are multiples of
    16, so every square includes the image's first pixel. Nothing is averaged, because the processor
    has neither the memory nor the time.

    Raises ValueError for a frame that ``size`` lacks.
    """
    if not 0 <= frame < size.frames:
        raise ValueError(f"{size.name} has frames 0 to {size.frames - 1}, not {frame}")
    position = frame * codes.FRAME_BYTES + np.arange(codes.FRAME_BYTES)
    row = (position // size.side - size.top) * size.step
    column = (position % size.side - size.left) * size.step
    inside = (row >= 0) & (row < codes.ROWS) & (column >= 0) & (column < codes.COLUMNS)
    return np.where(inside, row * codes.COLUMNS + column, OUTSIDE).astype(np.int32)


@dataclass(eq=False)
class ImageReader:
    """Reads any pixels of an image; in ascending order, the image is read once."""

    acquisition: Acquisition
    _sram: codes.Sram = field(default=codes.Sram.SRAM1, init=False)
    _next: int = field(default=0, init=False)

    def read(
        self, sram: codes.Sram, pixels: NDArray[np.int32], target: NDArray[np.uint8]
    ) -> Routine[bool]:
        """Read ascending ``pixels`` (n,) into ``target`` (n,); False if the memory is off."""
        if not len(pixels):
            return True
        breaks = np.flatnonzero(np.diff(pixels) != 1) + 1
        for start, end in pairwise((0, *map(int, breaks), len(pixels))):
            if not (yield from self._seek(sram, int(pixels[start]))):
                return False
            yield from self.acquisition.read_bytes(target[start:end])
            self._next += end - start
        return self.acquisition.image_open

    def read_run(self, sram: codes.Sram, start: int, count: int) -> Routine[bytes | None]:
        """``count`` pixels from ``start`` on; None if the memory is off."""
        data = np.zeros(count, np.uint8)
        pixels = np.arange(start, start + count, dtype=np.int32)
        done = yield from self.read(sram, pixels, data)
        return data.tobytes() if done else None

    def _seek(self, sram: codes.Sram, pixel: int) -> Routine[bool]:
        """Go to ``pixel``; one behind is reached from the first pixel again."""
        if not self.acquisition.image_open or sram != self._sram or pixel < self._next:
            self._sram, self._next = sram, 0
            if not (yield from self.acquisition.open_image(sram)):
                return False
        if pixel > self._next:
            yield from self.acquisition.skip_bytes(pixel - self._next)
            self._next = pixel
        return self.acquisition.image_open


class Download:
    """The frame that is being prepared, or is ready."""

    def __init__(self, meter: Meter, reader: ImageReader) -> None:
        self._meter = meter
        self._reader = reader
        self._wanted: FrameRequest | None = None
        self.data = np.zeros(codes.FRAME_BYTES, np.uint8)  #: its bytes
        self.number = codes.EMPTY_FRAME  #: of the ready frame, or ``EMPTY_FRAME``
        self.checksum = 0  #: of ``data`` if a frame is ready, else 0

    def has(self, frame: int) -> bool:
        return self._wanted is not None and frame < self._wanted.size.frames

    def request(self, values: Mapping[str, Any]) -> FrameRequest:
        """Interrupt: note the frame that a telecommand requests; the image must have it."""
        if "Frame" in values:
            assert self._wanted is not None
            wanted = FrameRequest(self._wanted.sram, self._wanted.size, values["Frame"])
        else:
            wanted = FrameRequest(codes.Sram(values["Sram"]), codes.ImageSize(values["Size"]), 0)
        self._select(wanted)
        return wanted

    def forget(self) -> None:
        self._select(None)

    def prepare(self, request: FrameRequest) -> Routine[None]:
        """Fill the frame; none becomes ready if the memory is off."""
        if request is not self._wanted:
            return
        pixels = frame_pixels(request.size, request.frame)
        inside = pixels != OUTSIDE
        values = np.zeros(np.count_nonzero(inside), np.uint8)
        self._meter.charge(
            i16_add=4 * codes.FRAME_BYTES, i8=codes.FRAME_BYTES, loop=codes.FRAME_BYTES
        )
        if not (yield from self._reader.read(request.sram, pixels[inside], values)):
            return
        self.data[:] = 0
        self.data[inside] = values
        self._meter.charge(i8=codes.FRAME_BYTES, loop=codes.FRAME_BYTES)
        yield Pay()
        if request is self._wanted:
            self.checksum = codes.checksum(self.data.tobytes())
            self.number = request.frame

    def _select(self, wanted: FrameRequest | None) -> None:
        self._wanted = wanted
        self.number = codes.EMPTY_FRAME
        self.checksum = 0


@dataclass(eq=False)
class ImageSender:
    """Sends images over the UART ``port``, one at a time and piece by piece, as it has room.

    The program does other jobs between two pieces.
    """

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
