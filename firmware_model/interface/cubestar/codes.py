"""Named numbers of CubeStar's interface: task states, reset causes, modes, error codes.

CubeSpace family of nodes, interface version 3. What the published tables leave open is assumed and
marked.
"""

from enum import IntEnum


class TaskStatus(IntEnum):
    """Latest activity of the node, telemetry TaskStatus."""

    POWERING_UP = 0
    POWERED_UP = 1
    CAMERA_INITIALISING = 2
    CAMERA_FAILED = 3
    CAMERA_INITIALISED = 4
    SETTING_EXPOSURE = 5
    EXPOSURE_FAILED = 6
    EXPOSURE_SET = 7
    WRITING_SENSOR = 8
    SENSOR_WRITTEN = 9
    READING_SENSOR = 10
    SENSOR_READ = 11
    RECEIVING_IMAGE = 12
    IMAGE_RECEIVED = 13
    RECEIVING_FAILED = 14
    CAPTURING = 15
    CAPTURE_FAILED = 16
    CAPTURED = 17
    SETTING_BLOCK = 18
    BLOCK_SET = 19
    BLOCK_FAILED = 20
    DETECTING = 21
    DETECTION_FAILED = 22
    DETECTED = 23
    IDENTIFYING = 24
    IDENTIFICATION_FAILED = 25
    IDENTIFIED = 26
    CALCULATING = 27
    CALCULATION_FAILED = 28
    CALCULATED = 29
    TESTING_SRAM = 30
    SRAM_TESTED = 31
    CAPTURING_PATTERN = 32
    PATTERN_CAPTURED = 33
    PATTERN_FAILED = 34
    FINDING_BEST_STARS = 35
    BEST_STARS_FAILED = 36
    BEST_STARS_FOUND = 37
    STREAMING_IMAGE = 38
    IMAGE_STREAMED = 39


class ResetCause(IntEnum):
    """Why the processor started; combinations of two causes have separate numbers."""

    POWER_ON = 1
    BROWN_OUT_UNREGULATED = 2
    BROWN_OUT_REGULATED = 3
    EXTERNAL_OR_WATCHDOG = 4
    EXTERNAL_PIN = 5
    WATCHDOG = 6
    LOCKUP_OR_SYSTEM_REQUEST = 7
    LOCKUP = 8
    SYSTEM_REQUEST = 9
    UNDETERMINED = 10


class ImageBlockSize(IntEnum):
    """Size of a downloaded block."""

    BYTES_32 = 0
    BYTES_64 = 1
    BYTES_128 = 2
    BYTES_256 = 3

    @property
    def length(self) -> int:
        return 32 << self


class IdMode(IntEnum):
    """Identification mode that the host requests."""

    TRACKING = 0
    LOST_IN_SPACE = 1


class MatchMode(IntEnum):
    """The firmware's own mode flag (CubeStar thesis, section 5.3.4)."""

    TRACKING = 0
    ASSISTED = 1
    LOST_IN_SPACE = 2


class TestPattern(IntEnum):
    """Pattern that CaptureTestPatern writes to the image memory; its pixels are assumed."""

    __test__ = False  # not a test class, whatever its name says to pytest

    MOVING = 0
    FIXED = 1
    RAMPING = 2


class MemoryTest(IntEnum):
    """Result of TestSRAM; assumed."""

    NOT_RUN = 0
    PASSED = 1
    FAILED = 2


class SwitchState(IntEnum):
    """Load switch of the imager and the frame buffer; assumed."""

    OFF = 0
    ON = 1


class Reason(IntEnum):
    """Why the latest image has no attitude, or SOLVED; telemetry Quality."""

    NOT_RATED = 0
    SOLVED = 1
    NO_PICTURE = 2
    TOO_FEW_STARS = 3
    STRAY_LIGHT = 4
    SATURATED = 5
    RADIATION = 6
    SMEAR = 7
    UNCONFIRMED = 8
    AMBIGUOUS = 9
    MIRRORED = 10
    NO_TIME = 11
    CONTRADICTION = 12
    LENS = 13  #: the stars do not fit the lens as described


class Disc(IntEnum):
    """The Moon's disc in the latest image; telemetry Bodies."""

    NOT_SOUGHT = 0  #: no Moon is listed
    NOT_SEEN = 1
    SEEN = 2  #: there is no attitude, or the image's edge cuts it
    CONFIRMED = 3  #: it is where the attitude puts it
    MISPLACED = 4  #: the attitude puts it elsewhere, and is refused
    ABSENT = 5  #: the attitude puts it into the image, and is refused


class RateOutcome(IntEnum):
    """Why the latest image has no body rate, or MEASURED; telemetry StellarGyro."""

    NOT_RUN = 0  #: switch gyro is off, or no image was processed
    MEASURED = 1
    NO_EARLIER_IMAGE = 2  #: the first image, or the same one again
    TOO_FAR_APART = 3
    UNTIMED = 4  #: uploaded, or its storing ended unseen while another image was processed
    TOO_FEW_STARS = 5
    UNMATCHED = 6
