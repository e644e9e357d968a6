"""Waveforms of a past time span, by a replay of the recording in another process."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

from cubestack.host.errors import TargetError

LONGEST_S = 60.0
"""Longest waveform, virtual time in s."""

TIMEOUT_S = 300.0
"""Time-out of the replay, wall time in s."""


class Bench:
    """Runs replays, one at a time."""

    def __init__(self) -> None:
        self._free = Lock()
        self._process: subprocess.Popen[str] | None = None
        self._closed = False

    def close(self) -> None:
        """End the current replay and reject new ones."""
        self._closed = True
        if self._process is not None:
            self._process.kill()

    def run(self, call: list[str]) -> str:
        """Run a command; returns its error output.

        Raises RuntimeError while another one runs, TargetError if it fails or times out.
        """
        if not self._free.acquire(blocking=False):
            raise RuntimeError("another waveform is being computed")
        try:
            if self._closed:
                raise TargetError("no waveform: the emulation is ending")
            return self._run(call)
        finally:
            self._free.release()

    def _run(self, call: list[str]) -> str:
        pipe = subprocess.PIPE
        with subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=pipe, text=True) as process:
            self._process = process
            try:
                _, errors = process.communicate(timeout=TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                late = f"no waveform within {TIMEOUT_S:g} s; choose an earlier time span"
                raise TargetError(late) from None
            finally:
                self._process = None
        if process.returncode:
            lines = errors.strip().splitlines()
            raise TargetError(f"no waveform: {lines[-1] if lines else process.returncode}")
        return errors


@dataclass(frozen=True)
class Trace:
    """A waveform to compute.

    Attributes:
        bench: runs the replay.
        recording: of the device.
        count: bytes of the recording to replay.
        from_s, to_s: span of virtual time.
    """

    bench: Bench
    recording: Path
    count: int
    from_s: float
    to_s: float

    def render(self) -> bytes:
        """The VCD file of `cubestack replay --trace`; raises as ``Bench.run`` does."""
        with TemporaryDirectory(prefix="cubestack-") as folder:
            recording, waveform = Path(folder) / "past.rec", Path(folder) / "span.vcd"
            with self.recording.open("rb") as stream:
                recording.write_bytes(stream.read(self.count))
            span = ["--trace-from", repr(self.from_s), "--trace-to", repr(self.to_s)]
            call = [sys.executable, "-P", "-m", "cubestack", "replay", str(recording)]
            self.bench.run([*call, "--trace", str(waveform), *span])
            return waveform.read_bytes()
