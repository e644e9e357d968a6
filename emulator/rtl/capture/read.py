"""Reads a capture of either format, by what the file begins with."""

from pathlib import Path

from cubestack.emulator.rtl.capture.capture import Capture, CaptureError
from cubestack.emulator.rtl.capture.read_csv import read_csv
from cubestack.emulator.rtl.capture.read_vcd import read_vcd
from cubestack.firmware_model.formats.untrusted import LARGEST_FILE, opened


def read_capture(path: Path) -> Capture:
    """Raises CaptureError for a damaged file, and OSError for one that can not be opened."""
    with opened(path, LARGEST_FILE, CaptureError) as stream:
        head = stream.read(4096)
    if not head.strip():
        raise CaptureError(f"{path} is empty")
    if b"\0" in head:
        raise CaptureError(
            f"{path} is neither VCD nor CSV; sigrok-cli -i {path.name} -O vcd converts sigrok's .sr"
        )
    return read_vcd(path) if head.lstrip().startswith(b"$") else read_csv(path)
