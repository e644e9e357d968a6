"""What a hazard of sensor or lens may do to a picture, and what it may know for that.

None of the effects is anything unless a hazard says so. Signals are electrons, whatever the sensor.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.residual import Residual
from cubestack.emulator.scene.hazards.hazard import Hazard

Field = NDArray[np.float32]


@dataclass(frozen=True)
class Exposure:
    """One exposure of one sensor.

    Attributes:
        shape: rows and columns.
        pitch_um: of its pixels.
        seconds: for which each pixel gathers charge.
        temperature_c: of the sensor.
        electrons_per_count: charge of one grey value of 8 bits, at this frame's gain.
    """

    shape: tuple[int, int]
    pitch_um: float
    seconds: float
    temperature_c: float
    electrons_per_count: float

    @property
    def area_cm2(self) -> float:
        """Of all pixels."""
        return self.shape[0] * self.shape[1] * (self.pitch_um * 1e-4) ** 2


@dataclass(frozen=True)
class Lens:
    """What hazards may change of any lens.

    Attributes:
        f_number: focal length by aperture.
        pitch_um: of the sensor's pixels.
        shape: rows and columns of the sensor.
        spot_px: standard deviation of a point's image.
        scale: focal length by what it should be.
        residuals: displacements of the picture.
    """

    f_number: float
    pitch_um: float
    shape: tuple[int, int]
    spot_px: float
    scale: float = 1.0
    residuals: tuple[Residual, ...] = ()


@dataclass(frozen=True, kw_only=True)
class SensorHazard(Hazard):
    """A hazard of sensor or lens."""

    def lens(self, lens: Lens, temperature_c: float) -> Lens:
        """The lens as this hazard makes it."""
        del temperature_c
        return lens

    def hot(self) -> int:
        """How many more pixels radiation has made hot, hot as this sensor's usually are."""
        return 0

    def dark_rise(self) -> float:
        """By what factor the mean dark current has grown."""
        return 1.0

    def response(self, shape: tuple[int, int]) -> Field | None:
        """Relative response (rows, columns) of the pixels; None for an even one."""
        del shape
        return None

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        """Electrons (rows, columns) that it adds to one frame; None for none.

        ``generator`` is the frame's own: another frame, another draw.
        """
        del exposure, generator
        return None

    def noise(self, exposure: Exposure) -> float:
        """Standard deviation of noise that it adds in each pixel, electrons."""
        del exposure
        return 0.0
