"""Waveforms of a running emulation: a span of its past is done again in a process of its own."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

from cubestack.host.errors import TargetError

LONGEST_S = 60.0
"""Virtual time that one waveform has."""

PATIENCE_S = 300.0
"""Wall time that the process may take."""

_one_at_a_time = Lock()


@dataclass(frozen=True)
class Trace:
    """A waveform that is to be made.

    Attributes:
        recording: file of what was done to the device.
        count: bytes of it that are written by now.
        from_s, to_s: virtual time that it shows.
    """

    recording: Path
    count: int
    from_s: float
    to_s: float

    def make(self) -> bytes:
        """The VCD file (`cubestack replay --trace`).

        Raises RuntimeError while another one is made, TargetError when it can not be made.
        """
        if not _one_at_a_time.acquire(blocking=False):
            raise RuntimeError("another waveform is being made")
        try:
            with TemporaryDirectory(prefix="cubestack-") as folder:
                return self._made(Path(folder))
        finally:
            _one_at_a_time.release()

    def _made(self, folder: Path) -> bytes:
        past, made = folder / "past.rec", folder / "span.vcd"
        with self.recording.open("rb") as stream:
            past.write_bytes(stream.read(self.count))
        span = ["--trace-from", repr(self.from_s), "--trace-to", repr(self.to_s)]
        call = [sys.executable, "-m", "cubestack", "replay", str(past), "--trace", str(made), *span]
        try:
            done = subprocess.run(call, capture_output=True, text=True, timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            late = f"no waveform within {PATIENCE_S:g} s: there is too much before it"
            raise TargetError(late) from None
        if done.returncode:
            told = done.stderr.strip().splitlines()
            raise TargetError(f"no waveform: {told[-1] if told else done.returncode}")
        return made.read_bytes()
