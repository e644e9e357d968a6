"""Image download from a CubeSense in frames of 128 bytes.

CubeSpace family with two cameras, interface generation 2: a telecommand prepares a frame; telemetry
ImageFrameInfo is polled until it is ready; then the frame is read and its checksum compared.
"""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import ImageSize, Sram
from cubestack.host.clients.contract import Client, Progress
from cubestack.host.errors import BadAnswerError, HostError, NoAnswerError

POLL_PERIOD_S = 0.04
FRAME_TIMEOUT_S = 2.0

#: Retries for a wrong checksum, and for a lost acknowledge.
ATTEMPTS = 3


def download_image(
    client: Client, sram: Sram, size: ImageSize, progress: Progress | None = None
) -> NDArray[np.uint8]:
    """The square image (side, side) of ``size`` in ``sram``, first row on top.

    ``picture_of`` crops it. Raises NoAnswerError if a frame is not ready in time, BadAnswerError if
    it is damaged three times, and the errors of ``client``.
    """
    client.command("StartImageDownload", Sram=sram, Location=codes.ImageLocation.TOP, Size=size)
    square = np.empty((size.frames, codes.FRAME_BYTES), np.uint8)
    for number in range(size.frames):
        if number:
            _prepare(client, number)
        square[number] = np.frombuffer(_read(client, number, sram), np.uint8)
        if progress is not None:
            progress(number + 1, size.frames)
    return square.reshape(size.side, size.side)


def picture_of(square: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The image within a downloaded square (side, side): 480 x 640 for the largest.

    Raises ValueError for another shape.
    """
    for size in ImageSize:
        if square.shape == (size.side, size.side):
            rows, columns = codes.ROWS // size.step, codes.COLUMNS // size.step
            return square[size.top : size.top + rows, size.left : size.left + columns]
    sides = ", ".join(str(size.side) for size in ImageSize)
    raise ValueError(f"a downloaded square has a side of {sides}, not the shape {square.shape}")


def _prepare(client: Client, number: int) -> None:
    """Request a frame; retries after a lost acknowledge, as a repeated request does no harm."""
    for attempt in range(ATTEMPTS):
        try:
            client.command("NextImageFrame", Frame=number)
            return
        except NoAnswerError:
            if attempt + 1 == ATTEMPTS:
                raise


def _read(client: Client, number: int, sram: Sram) -> bytes:
    """The frame, once it is ready."""
    expected = _wait_ready(client, number, sram)
    for _ in range(ATTEMPTS):
        frame = client.telemetry("ImageFrame")["Frame"]
        assert isinstance(frame, bytes)
        found = codes.checksum(frame)
        if found == expected:
            return frame
    raise BadAnswerError(
        f"image frame {number}: checksum {found:#04x}, not {expected:#04x}, in {ATTEMPTS} reads"
    )


def _wait_ready(client: Client, number: int, sram: Sram) -> int:
    """Poll until the frame is ready; returns its checksum."""
    for _ in range(math.ceil(FRAME_TIMEOUT_S / POLL_PERIOD_S)):
        values = client.telemetry("ImageFrameInfo")
        if values["FrameNumber"] == number:
            return int(values["Checksum"])
        client.pause(POLL_PERIOD_S)
    late = f"image frame {number} not ready within {FRAME_TIMEOUT_S:g} s"
    with suppress(HostError):
        if client.telemetry("Power")[f"OverCurrent{sram + 1}"]:
            late += f": {sram.name} drew too much current and may be off (see telemetry Power)"
    raise NoAnswerError(late)
