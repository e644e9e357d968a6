"""What a CubeSense is told and tells: measurements, settings, masks, supply currents.

Axes of each camera: x right, y down, z out of the lens.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, DetectResult


def direction(alpha_deg: float, beta_deg: float) -> NDArray[np.float64]:
    """Unit vector (3,) in camera axes of a measurement's two angles.

    Both are parts of the field angle: it is their root of squares, towards (alpha, beta).
    """
    theta = math.radians(math.hypot(alpha_deg, beta_deg))
    phi = math.atan2(beta_deg, alpha_deg)
    return np.array(
        [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
    )


@dataclass(frozen=True)
class Measurement:
    """What a camera measured.

    Attributes:
        camera: the camera.
        alpha_deg, beta_deg: parts of the field angle along x and y; they count when ``detected``.
        capture: what became of the capture.
        detect: what became of the detection.
    """

    camera: Camera
    alpha_deg: float
    beta_deg: float
    capture: CaptureResult
    detect: DetectResult

    @property
    def detected(self) -> bool:
        """Whether the angles are a measurement."""
        return self.detect is DetectResult.SUCCESS

    @property
    def pending(self) -> bool:
        """Whether the node still works on it."""
        return self.capture is CaptureResult.PENDING or self.detect is DetectResult.PENDING

    @property
    def vector(self) -> NDArray[np.float64]:
        """Unit vector (3,) in camera axes."""
        return direction(self.alpha_deg, self.beta_deg)


@dataclass(frozen=True)
class CameraSettings:
    """Exposure in units of two line times (127 us), gain, and gains of the two colours."""

    exposure: int
    gain: int = 0
    blue_gain: int = 0x80
    red_gain: int = 0x80


@dataclass(frozen=True)
class Mask:
    """A rectangle of pixels, ends included."""

    x_min: int
    x_max: int
    y_min: int
    y_max: int


@dataclass(frozen=True)
class Power:
    """Supply currents in mA, and whether each memory drew too much since its flag was cleared."""

    current_3v3_ma: float
    current_sram_ma: tuple[float, float]
    current_5v_ma: float
    over_current: tuple[bool, bool]
