"""Client of CubeSense's service port: one-letter protocol, CubeSense thesis, appendix E."""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.letters import Letter
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, ROWS, Camera
from cubestack.firmware_model.interface.cubesense.service_port import CAPTURES, DOWNLOADS
from cubestack.host.clients.contract import Progress
from cubestack.host.errors import BadAnswerError, NoAnswerError
from cubestack.host.transport.streams import Transport

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
