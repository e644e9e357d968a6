"""Lenses that differ from the one that the firmware assumes: out of focus, longer, distorted."""

import math
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.polynomial.legendre import leg2poly

from cubestack.emulator.camera.common.hazards.contract import Lens, SensorHazard
from cubestack.emulator.camera.common.residual import Residual
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import number

CALIBRATED_C = 20.0
"""Temperature at which lenses have the focus and focal length that the firmware assumes."""

ORDERS = range(2, 5)
"""Of the residual's polynomials: lower ones would turn, scale or shear the picture."""


@dataclass(frozen=True, kw_only=True)
class Defocus(SensorHazard):
    """A wider image of each point.

    A cone of light that ends before or behind the sensor is a disc there; its diameter is the
    distance divided by the f-number, its standard deviation along one axis a quarter of that. The
    spot gets that standard deviation, but its shape is Gaussian.
    """

    meaning = "a lens out of focus, by temperature or by the spot's width"
    strength = Strength("sigma_px", "px", (1, 1.5, 2, 3, 4, 6), 3)

    sigma_px: float | None = number(None, "standard deviation of the whole spot", 0.3, 20)
    um_per_k: float = number(0.5, "if omitted: shift of the focus in um per K from 20 C", -50, 50)

    def lens(self, lens: Lens, temperature_c: float) -> Lens:
        if self.sigma_px is not None:
            return replace(lens, spot_px=self.sigma_px)
        disc_um = self.um_per_k * (temperature_c - CALIBRATED_C) / lens.f_number
        return replace(lens, spot_px=math.hypot(lens.spot_px, disc_um / lens.pitch_um / 4))


@dataclass(frozen=True, kw_only=True)
class FocalLength(SensorHazard):
    """A picture that is larger or smaller about its principal point, distortion included."""

    meaning = "another focal length than calibrated"
    strength = Strength("percent", "%", (0, 0.1, 0.3, 0.5, 1, 3), 1)

    percent: float = number(0.0, "increase at 20 C, per cent", -10, 10)
    ppm_per_k: float = number(20.0, "increase per K above 20 C, millionths", -500, 500)

    @classmethod
    def sample(cls, strength: float, state: Any, generator: np.random.Generator) -> Self:
        return replace(
            super().sample(strength, state, generator),
            percent=strength * float(generator.choice([-1, 1])),
        )

    def lens(self, lens: Lens, temperature_c: float) -> Lens:
        warm = 1 + self.ppm_per_k * 1e-6 * (temperature_c - CALIBRATED_C)
        return replace(lens, scale=lens.scale * (1 + self.percent / 100) * warm)


@dataclass(frozen=True, kw_only=True)
class LensResiduals(SensorHazard):
    """A smooth distortion beside the calibrated one: random polynomials of second to fourth order.

    They are Legendre polynomials: on average over the sensor they do not shift, scale or turn it.
    """

    meaning = "a smooth distortion that the calibration lacks"
    strength = Strength("rms_px", "px", (0, 0.1, 0.2, 0.5, 1, 2), 0.5)

    rms_px: float = number(0.3, "root of the mean squared displacement over the sensor", 0, 10)

    def lens(self, lens: Lens, temperature_c: float) -> Lens:
        del temperature_c
        generator = np.random.default_rng([self.seed, 0x2E5])
        size = ORDERS.stop
        coefficients = generator.standard_normal((2, size, size))
        order = np.add.outer(np.arange(size), np.arange(size))
        coefficients[:, ~np.isin(order, ORDERS)] = 0
        odd = 2 * np.arange(size) + 1
        square = (coefficients**2 / np.outer(odd, odd)).sum()
        coefficients *= self.rms_px / math.sqrt(square)
        # The columns of this matrix are Legendre polynomials.
        powers = np.array([np.pad(leg2poly(row), (0, size))[:size] for row in np.eye(size)]).T
        across, down = (tuple(map(tuple, (powers @ c @ powers.T).tolist())) for c in coefficients)
        return replace(lens, residuals=(*lens.residuals, Residual(lens.shape, across, down)))
