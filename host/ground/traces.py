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


class Bench:
    """Where waveforms are made, one at a time."""

    def __init__(self) -> None:
        self._free = Lock()
        self._process: subprocess.Popen[str] | None = None
        self._closed = False

    def close(self) -> None:
        """End what is being made; nothing more is."""
        self._closed = True
        if self._process is not None:
            self._process.kill()

    def run(self, call: list[str]) -> str:
        """Run a command to its end; what it said.

        Raises RuntimeError while another one runs, TargetError when it fails or takes too long.
        """
        if not self._free.acquire(blocking=False):
            raise RuntimeError("another waveform is being made")
        try:
            if self._closed:
                raise TargetError("no waveform: the emulation ends")
            return self._run(call)
        finally:
            self._free.release()

    def _run(self, call: list[str]) -> str:
        pipe = subprocess.PIPE
        with subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=pipe, text=True) as process:
            self._process = process
            try:
                _, said = process.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                late = f"no waveform within {PATIENCE_S:g} s: there is too much before it"
                raise TargetError(late) from None
            finally:
                self._process = None
        if process.returncode:
            told = said.strip().splitlines()
            raise TargetError(f"no waveform: {told[-1] if told else process.returncode}")
        return said


@dataclass(frozen=True)
class Trace:
    """A waveform that is to be made.

    Attributes:
        bench: where.
        recording: file of what was done to the device.
        count: bytes of it that are written by now.
        from_s, to_s: virtual time that it shows.
    """

    bench: Bench
    recording: Path
    count: int
    from_s: float
    to_s: float

    def make(self) -> bytes:
        """The VCD file (`cubestack replay --trace`).

        Raises as ``Bench.run``.
        """
        with TemporaryDirectory(prefix="cubestack-") as folder:
            past, made = Path(folder) / "past.rec", Path(folder) / "span.vcd"
            with self.recording.open("rb") as stream:
                past.write_bytes(stream.read(self.count))
            span = ["--trace-from", repr(self.from_s), "--trace-to", repr(self.to_s)]
            call = [sys.executable, "-m", "cubestack", "replay", str(past), "--trace", str(made)]
            self.bench.run([*call, *span])
            return made.read_bytes()
