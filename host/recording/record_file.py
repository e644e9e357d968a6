"""A recording or trace on a disk that may be full: it stops there, and the emulation goes on."""

import logging
import os
from contextlib import suppress
from typing import IO

BUFFER = 1 << 16
"""Bytes that wait for the disk."""

_log = logging.getLogger(__name__)


class RecordFile:
    """Passes text on to an open file, up to the first error or ``largest`` bytes.

    The file then ends with a whole line, a warning names it, and further text is dropped.

    Attributes:
        name: of the file.
        stopped: the file and why it ends there; empty as long as it does not.
    """

    def __init__(self, stream: IO[str], largest: int | None = None) -> None:
        """Write to ``stream``, which is new and which the caller closes."""
        self.name, self.stopped = stream.name, ""
        self._largest, self._file = largest, stream.fileno()
        self._waiting = bytearray()
        self._size = self._whole = 0  # bytes in the file, and those up to the last line's end

    def write(self, text: str) -> int:
        if not self.stopped:
            self._waiting += text.encode("utf-8")
            if len(self._waiting) >= BUFFER:
                self.flush()
        return len(text)

    def flush(self) -> None:
        """Have readers see all that was written."""
        if self._largest is not None and self._size + len(self._waiting) > self._largest:
            self._stop(f"it has reached {self._largest >> 20} MB")
        try:
            while self._waiting:
                count = os.write(self._file, self._waiting)
                line_end = self._waiting.rfind(b"\n", 0, count) + 1
                self._whole = self._size + line_end if line_end else self._whole
                self._size += count
                del self._waiting[:count]
        except OSError as error:
            self._stop(error.strerror or str(error))

    def _stop(self, reason: str) -> None:
        self.stopped = f"{self.name}: {reason}"
        self._waiting.clear()
        with suppress(OSError):  # a pipe
            os.ftruncate(self._file, self._whole)
        _log.warning("%s; it ends here, and the emulation goes on", self.stopped)
