"""Named numbers of CubeSense's interface, the image geometry, and two-byte values.

CubeSpace family of nodes with two cameras, interface generation 2; geometry and scales from the
CubeSense thesis, sections 2.3 to 5.2 and 6.1. What the public material leaves open is assumed and
marked.
"""

import math
from enum import IntEnum
from functools import reduce
from operator import xor

from cubestack.firmware_model.interface.cameras import ov7620

COLUMNS, ROWS = ov7620.COLUMNS, ov7620.ROWS

#: Bytes of an image, row by row.
IMAGE_BYTES = COLUMNS * ROWS

#: Bytes per frame of a download.
FRAME_BYTES = 128

#: Frame number of telemetry ImageFrameInfo while no frame is ready; assumed.
EMPTY_FRAME = 0xFFFF

#: Number of areas in a camera's mask.
MASK_AREAS = 5

#: Edge coordinates are in 1/32 px; edges per telemetry frame. Both are assumed.
EDGE_UNIT = 32
EDGES_PER_FRAME = 20

#: Undistorted pixels per degree of field angle.
PIXELS_PER_DEGREE = 2.9

#: Largest alpha or beta, of either sign, that a result may have.
LARGEST_ANGLE_DEG = 100


class Camera(IntEnum):
    """Camera; the tables' camera 1 is number 0, camera 2 is number 1."""

    SUN = 0
    NADIR = 1


class Sram(IntEnum):
    """Image memory; a camera's own one has the camera's number."""

    SRAM1 = 0
    SRAM2 = 1


class SramSelection(IntEnum):
    """Memories whose over-current flags are cleared."""

    SRAM1 = 0
    SRAM2 = 1
    BOTH = 2


class ResetTarget(IntEnum):
    """Part that telecommand Reset restarts."""

    COMMUNICATION = 1
    CAMERAS = 2
    MCU = 3


class ImageLocation(IntEnum):
    """Half of a memory; a 512 kB memory holds one image, so only TOP is accepted."""

    TOP = 0
    BOTTOM = 1


class CaptureResult(IntEnum):
    """Outcome of the latest capture of a camera."""

    START_UP = 0
    PENDING = 1
    STORED_OWN_SRAM = 2
    STORED_OTHER_SRAM = 3
    CAMERA_TIMEOUT = 4
    SRAM_OVER_CURRENT = 5

    @property
    def stored(self) -> bool:
        return self in (CaptureResult.STORED_OWN_SRAM, CaptureResult.STORED_OTHER_SRAM)


class DetectResult(IntEnum):
    """Outcome of the latest detection of a camera."""

    START_UP = 0
    NONE_SCHEDULED = 1
    PENDING = 2
    TOO_MANY_EDGES = 3
    TOO_FEW_EDGES = 4
    BAD_FIT = 5
    SUN_NOT_FOUND = 6
    SUCCESS = 7


class Reason(IntEnum):
    """Why a detection ended as it did, from the firmware's measurements; an extension."""

    NONE = 0  #: no detection yet, or one by the published program, which reports none
    MEASURED = 1
    FEW_EDGES = 2
    MANY_EDGES = 3
    NO_CIRCLE = 4  #: the edges lie on no common circle with its bright side inside
    OTHER_LIGHT = 5  #: most edges lie off the best circle
    WRONG_RADIUS = 6
    """The circle is impossible at an altitude of interest, or its centre is too far away."""
    NO_LIGHT = 7  #: no run of bright pixels, or too few of them for a Sun
    TOO_LARGE = 8  #: more bright pixels than a Sun has: the Earth, or structure
    NOT_ROUND = 9
    NOT_SATURATED = 10  #: the Sun's middle is saturated, a reflection's is not
    SHARP = 11
    """Found, but the edge is sharper than that of the Sun's image: it may be no Sun."""
    OUT_OF_FIELD = 12


class Measurement(IntEnum):
    """Camera and memory in one number, for the register protocol; an extension."""

    SUN_SRAM1 = 0
    SUN_SRAM2 = 1
    NADIR_SRAM1 = 2
    NADIR_SRAM2 = 3

    @property
    def camera(self) -> Camera:
        return Camera(self >> 1)

    @property
    def sram(self) -> Sram:
        return Sram(self & 1)


class NadirSearch(IntEnum):
    """Search method for the nadir camera's edges (CubeSense thesis, 6.5.1, 9.2.2); an extension.

    Along scanned lines, or around samples with addresses that the processor chooses: between two
    differing samples by bisection, or one pixel after the other.
    """

    LINES = 0
    AROUND_SAMPLES = 1
    AROUND_SAMPLES_STEPPING = 2


class ImageSize(IntEnum):
    """Side of a downloaded square; the square of 1024 has the image in its middle.

    The position of the image, and that a smaller square takes every n-th pixel of every n-th row
    from the first on, are assumed.
    """

    SIDE_1024 = 0
    SIDE_512 = 1
    SIDE_256 = 2
    SIDE_128 = 3
    SIDE_64 = 4

    @property
    def step(self) -> int:
        """Every step-th pixel of every step-th row of the largest square is sent."""
        return 1 << self

    @property
    def side(self) -> int:
        return 1024 // self.step

    @property
    def frames(self) -> int:
        return self.side * self.side // FRAME_BYTES

    @property
    def left(self) -> int:
        """Column of the square at which the image begins."""
        return (1024 - COLUMNS) // 2 // self.step

    @property
    def top(self) -> int:
        """Row of the square at which the image begins."""
        return (1024 - ROWS) // 2 // self.step


def checksum(frame: bytes) -> int:
    """Checksum of a downloaded frame: the exclusive OR of its bytes; the algorithm is assumed."""
    return reduce(xor, frame, 0)


def coefficient(mantissa: int, exponent: int) -> float:
    """Distortion coefficient: mantissa (i16) / 10^exponent (0 to 255); assumed."""
    return float(mantissa) / 10.0**exponent


def split_coefficient(value: float) -> tuple[int, int]:
    """Mantissa and exponent of ``value``, with a relative error of up to 1.6e-4.

    Raises ValueError beyond 32767 and for NaN.
    """
    if not abs(value) <= 32767:
        raise ValueError(f"a distortion coefficient is within +-32767, not {value}")
    if value == 0:
        return 0, 0
    exponent = min(max(4 - math.floor(math.log10(abs(value))), 0), 255)
    mantissa = round(value * 10.0**exponent)
    if abs(mantissa) > 32767:
        exponent -= 1
        mantissa = round(value * 10.0**exponent)
    return mantissa, exponent
