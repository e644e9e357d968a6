"""Image download from a CubeSense in frames of 128 bytes.

CubeSpace family with two cameras, interface generation 2: a telecommand prepares a frame; telemetry
ImageFrameInfo is polled until it is ready; then the frame is read and its checksum compared. The
service port sends a whole image: one-letter protocol, CubeSense thesis, appendix E.
"""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.letters import Letter
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import (
    COLUMNS,
    ROWS,
    Camera,
    ImageSize,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.service_port import CAPTURES, DOWNLOADS
from cubestack.host.clients.contract import Client, Progress
from cubestack.host.errors import BadAnswerError, HostError, NoAnswerError
from cubestack.host.transport.streams import Transport

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


READ_BYTES = 4096


class ServicePortClient:
    """A bench computer on the serial line; the caller opens and closes that."""

    def __init__(self, transport: Transport, *, timeout_s: float = 2.0) -> None:
        """Use ``transport``; ``timeout_s`` is the longest silence before or within an answer."""
        self._transport = transport
        self._timeout_s = timeout_s

    def take(self, camera: Camera) -> None:
        """Capture an image; returns when it is stored. Raises NoAnswerError, BadAnswerError."""
        letter = CAPTURES[camera]
        answer = self._ask(letter)
        if answer != letter.answer:
            raise BadAnswerError(
                f"bench letter {letter.letter!r} answered with {answer!r}, not {letter.answer!r}"
            )

    def download(self, camera: Camera, progress: Progress | None = None) -> NDArray[np.uint8]:
        """The image (480, 640) in the camera's own memory, first row on top.

        ``progress`` is called with (bytes done, total). Raises NoAnswerError if the line falls
        silent before the end.
        """
        data = self._ask(DOWNLOADS[camera], progress)
        return np.frombuffer(data, np.uint8).reshape(ROWS, COLUMNS)

    def _ask(self, letter: Letter, progress: Progress | None = None) -> bytes:
        while self._transport.read(READ_BYTES, 0.0):
            pass  # drop the rest of an earlier answer
        self._transport.write(letter.request)
        answer = bytearray()
        while len(answer) < letter.length:
            wanted = min(READ_BYTES, letter.length - len(answer))
            data = self._transport.read(wanted, self._timeout_s)
            if not data:
                raise NoAnswerError(
                    f"bench letter {letter.letter!r}: {len(answer)} bytes of {letter.length} came, "
                    f"then nothing for {self._timeout_s:g} s"
                )
            answer += data
            if progress is not None:
                progress(len(answer), letter.length)
        return bytes(answer)
