"""Interface of a hazard of sensor or lens: its effects on an image, and their inputs.

By default, a hazard has no effect. Signals are in electrons, for any sensor.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.residual import Displacement
from cubestack.emulator.scene.hazards.hazard import Hazard

Field = NDArray[np.float32]


@dataclass(frozen=True)
class Exposure:
    """One exposure of one sensor."""

    shape: tuple[int, int]  # rows and columns
    pitch_um: float  # pixel pitch
    seconds: float  # exposure of each pixel
    temperature_c: float  # temperature of the sensor
    electrons_per_count: float  # charge of one grey value of 8 bits, at this frame's gain

    @property
    def area_cm2(self) -> float:
        return self.shape[0] * self.shape[1] * (self.pitch_um * 1e-4) ** 2


@dataclass(frozen=True)
class Lens:
    """The properties of a lens that hazards may change."""

    f_number: float  # focal length divided by aperture
    pitch_um: float  # pixel pitch of the sensor
    shape: tuple[int, int]  # rows and columns of the sensor
    middle: tuple[float, float]  # principal point: column and row, px
    spot_px: float  # standard deviation of a point's image
    scale: float = 1.0  # focal length relative to its nominal value
    residuals: tuple[Displacement, ...] = ()  # displacements of the image


@dataclass(frozen=True, kw_only=True)
class SensorHazard(Hazard):
    """A hazard of sensor or lens."""

    def lens(self, lens: Lens, temperature_c: float) -> Lens:
        """The lens as changed by this hazard."""
        del temperature_c
        return lens

    def hot_pixels(self) -> int:
        """Number of additional hot pixels, as hot as usual for the sensor."""
        return 0

    def dark_rise(self) -> float:
        return 1.0

    def response(self, shape: tuple[int, int]) -> Field | None:
        """Relative response (rows, columns) of the pixels; None for an even one."""
        del shape
        return None

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        """Electrons (rows, columns) that it adds to one frame, or None.

        ``generator`` belongs to the frame.
        """
        del exposure, generator
        return None

    def noise(self, exposure: Exposure) -> float:
        """Standard deviation of the noise that it adds in each pixel, electrons."""
        del exposure
        return 0.0
