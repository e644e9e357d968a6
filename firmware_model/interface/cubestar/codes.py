"""Numbers with names in CubeStar's interface: task states, reset causes, modes, error codes.

CubeSpace family of nodes, interface version 3. What the published tables leave open is assumed, and
marked so.
"""

from enum import IntEnum


class TaskStatus(IntEnum):
    """What the node last did, telemetry TaskStatus."""

    POWERED_UP = 1
    CAPTURING = 15
    CAPTURE_FAILED = 16
    CAPTURED = 17
    DETECTING = 21
    DETECTION_FAILED = 22
    DETECTED = 23
    IDENTIFYING = 24
    IDENTIFICATION_FAILED = 25
    IDENTIFIED = 26
    CALCULATING = 27
    CALCULATION_FAILED = 28
    CALCULATED = 29


class ResetCause(IntEnum):
    """Reset-cause bit of the EFM32GG (reference manual, RMU_RSTCAUSE), counted from 1."""

    POWER_ON = 1
    BROWN_OUT_UNREGULATED = 2
    BROWN_OUT_REGULATED = 3
    EXTERNAL_PIN = 4
    WATCHDOG = 5
    LOCKUP = 6
    SYSTEM_REQUEST = 7
    EM4 = 8
    EM4_WAKE_UP = 9
    BROWN_OUT_AVDD0 = 10


class ImageBlockSize(IntEnum):
    """Size of a downloaded block."""

    BYTES_32 = 0
    BYTES_64 = 1
    BYTES_128 = 2
    BYTES_256 = 3

    @property
    def length(self) -> int:
        """Bytes of a block."""
        return 32 << self


class IdMode(IntEnum):
    """Identification mode that the host asks for."""

    TRACKING = 0
    LOST_IN_SPACE = 1


class MatchMode(IntEnum):
    """The firmware's own mode flag (CubeStar thesis, section 5.3.4)."""

    TRACKING = 0
    ASSISTED = 1
    LOST_IN_SPACE = 2


class TestPattern(IntEnum):
    """Pattern that CaptureTestPatern writes to the picture memory; assumed."""

    __test__ = False  # not a test class, whatever its name says to pytest

    COLUMN_RAMP = 0
    ROW_RAMP = 1
    DIAGONAL_RAMP = 2


class MemoryTest(IntEnum):
    """Result of TestSRAM; assumed."""

    NOT_RUN = 0
    PASSED = 1
    FAILED = 2


class SwitchState(IntEnum):
    """Load switch of the imager and the frame buffer; assumed."""

    OFF = 0
    ON = 1
