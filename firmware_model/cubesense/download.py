"""Pictures on their way to a host: a reader that goes on where it stopped, and frames of 128 bytes.

An FPGA hands out a picture in sequence. `PictureReader` therefore leaves it open between two reads.
What lies ahead is passed over; for what lies behind, and after somebody else needed the FPGAs, it
begins anew. A download in the order of its frames reads the picture once.

CubeSpace family with two cameras, interface generation 2: telecommands 64 and 65 ask for a frame,
telemetry 65 says when it is ready, 64 has it. Assumed: while a frame is being prepared, telemetry
64 has what its buffer holds; a frame that a later request has overtaken is not prepared.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.acquisition import Acquisition
from cubestack.firmware_model.cubesense.jobs import FrameRequest
from cubestack.firmware_model.cubesense.thumbnail import OUTSIDE, frame_pixels
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Routine


@dataclass(eq=False)
class PictureReader:
    """Any pixels of a picture; in ascending order it is read once."""

    acquisition: Acquisition
    _sram: codes.Sram = field(default=codes.Sram.SRAM1, init=False)
    _next: int = field(default=0, init=False)

    def read(
        self, sram: codes.Sram, pixels: NDArray[np.int32], target: NDArray[np.uint8]
    ) -> Routine[bool]:
        """Read ``pixels`` (n,), numbers that ascend, into ``target`` (n,).

        False when the memory is off, or was cut off meanwhile.
        """
        if not len(pixels):
            return True
        breaks = np.flatnonzero(np.diff(pixels) != 1) + 1
        for start, end in pairwise((0, *map(int, breaks), len(pixels))):
            if not (yield from self._seek(sram, int(pixels[start]))):
                return False
            yield from self.acquisition.read_bytes(target[start:end])
            self._next += end - start
        return self.acquisition.picture_open

    def read_run(self, sram: codes.Sram, start: int, count: int) -> Routine[bytes | None]:
        """``count`` pixels from ``start`` on; None as where ``read`` gives False."""
        data = np.zeros(count, np.uint8)
        pixels = np.arange(start, start + count, dtype=np.int32)
        done = yield from self.read(sram, pixels, data)
        return data.tobytes() if done else None

    def _seek(self, sram: codes.Sram, pixel: int) -> Routine[bool]:
        """Go to ``pixel``; what lies behind is reached from the first one again."""
        if not self.acquisition.picture_open or sram != self._sram or pixel < self._next:
            self._sram, self._next = sram, 0
            if not (yield from self.acquisition.open_picture(sram)):
                return False
        if pixel > self._next:
            yield from self.acquisition.skip_bytes(pixel - self._next)
            self._next = pixel
        return self.acquisition.picture_open


class Download:
    """The frame that is being prepared, or is ready.

    Attributes:
        data: its bytes.
        number: of the frame that is ready; ``EMPTY_FRAME`` when none is.
        checksum: of ``data``, when a frame is ready, else 0.
    """

    def __init__(self, meter: Meter, reader: PictureReader) -> None:
        """No picture is selected."""
        self._meter = meter
        self._reader = reader
        self._wanted: FrameRequest | None = None
        self.data = np.zeros(codes.FRAME_BYTES, np.uint8)
        self.number = codes.EMPTY_FRAME
        self.checksum = 0

    def has(self, frame: int) -> bool:
        """Whether a picture is selected and has so many frames."""
        return self._wanted is not None and frame < self._wanted.size.frames

    def request(self, values: Mapping[str, Any]) -> FrameRequest:
        """Interrupt: note which frame is wanted, from the parameters of either telecommand.

        A frame that the selected picture does not have is the caller's mistake; see ``has``.
        """
        if "Frame" in values:
            assert self._wanted is not None
            wanted = FrameRequest(self._wanted.sram, self._wanted.size, values["Frame"])
        else:
            wanted = FrameRequest(codes.Sram(values["Sram"]), codes.ImageSize(values["Size"]), 0)
        self._select(wanted)
        return wanted

    def forget(self) -> None:
        """No picture is selected any more."""
        self._select(None)

    def prepare(self, request: FrameRequest) -> Routine[None]:
        """Fill the frame; none becomes ready when the memory is off."""
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
