"""Lenses that differ from the one that the firmware assumes: out of focus, longer, distorted."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.polynomial.legendre import leg2poly

from cubestack.emulator.camera.common.hazards.contract import Lens, SensorHazard
from cubestack.emulator.camera.common.residual import Displacement, Residual, Swing, Warp
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


@dataclass(frozen=True, kw_only=True)
class _Misdescribed(SensorHazard, ABC):
    """A lens whose camera file is wrong in one respect."""

    @classmethod
    def sample(cls, strength: float, state: Any, generator: np.random.Generator) -> Self:
        one = super().sample(strength, state, generator)
        signed: dict[str, Any] = {cls.strength.key: strength * float(generator.choice([-1, 1]))}
        return replace(one, **signed)

    @abstractmethod
    def displacement(self, lens: Lens) -> Displacement:
        """What it does to the picture, in px."""

    def lens(self, lens: Lens, temperature_c: float) -> Lens:
        del temperature_c
        if getattr(self, self.strength.key) == 0:
            return lens
        return replace(lens, residuals=(*lens.residuals, self.displacement(lens)))


@dataclass(frozen=True, kw_only=True)
class PixelAspect(_Misdescribed):
    """Pixels that are wider than high, where the camera file has square ones: fx is not fy."""

    meaning = "pixels wider than high, or fx and fy that differ"
    strength = Strength("percent", "%", (0, 0.5, 1, 2, 5), 2)

    percent: float = number(0.0, "width of the picture beyond its calibration, per cent", -10, 10)

    def displacement(self, lens: Lens) -> Displacement:
        wider = self.percent / 100
        return Warp(lens.middle, ((wider / (1 + wider), 0.0), (0.0, 0.0)))


@dataclass(frozen=True, kw_only=True)
class PixelSkew(_Misdescribed):
    """Rows and columns that are not square to each other."""

    meaning = "rows and columns that are not at right angles"
    strength = Strength("percent", "%", (0, 0.5, 1, 2, 5), 2)

    percent: float = number(0.0, "shift of a row per row, per cent", -10, 10)

    def displacement(self, lens: Lens) -> Displacement:
        return Warp(lens.middle, ((0.0, self.percent / 100), (0.0, 0.0)))


@dataclass(frozen=True, kw_only=True)
class PrincipalPoint(_Misdescribed):
    """A lens beside its calibrated place: the picture is shifted, with its distortion."""

    meaning = "a lens beside its calibrated place"
    strength = Strength("px", "px", (0, 5, 10, 20, 40), 10)

    px: float = number(0.0, "shift of the picture", -100, 100)
    direction_deg: float = number(0.0, "of the shift, from the row's direction", -360, 360)

    @classmethod
    def sample(cls, strength: float, state: Any, generator: np.random.Generator) -> Self:
        one = super().sample(strength, state, generator)
        return replace(one, direction_deg=360 * float(generator.random()))

    def displacement(self, lens: Lens) -> Displacement:
        angle = math.radians(self.direction_deg)
        across, down = self.px * math.cos(angle), self.px * math.sin(angle)
        return Residual(lens.shape, ((across,),), ((down,),))


@dataclass(frozen=True, kw_only=True)
class RadialDistortion(_Misdescribed):
    """A pincushion, or for negative values a barrel, that the calibration lacks."""

    meaning = "distortion towards the corners that the calibration lacks"
    strength = Strength("px", "px", (0, 2, 5, 10, 20), 5)

    px: float = number(0.0, "displacement at half a diagonal from the principal point", -100, 100)

    def displacement(self, lens: Lens) -> Displacement:
        rows, columns = lens.shape
        return Warp(lens.middle, cubic=self.px / math.hypot(rows / 2, columns / 2) ** 3)


@dataclass(frozen=True, kw_only=True)
class Wobble(_Misdescribed):
    """A camera that shakes while its rows are read in turn: each row has its own displacement."""

    meaning = "rows that swing while they are read in turn"
    strength = Strength("px", "px", (0, 0.5, 1, 2, 3), 3)

    px: float = number(0.0, "largest displacement", -20, 20)
    swings: float = number(1.5, "during the read-out", 0.1, 20)

    def displacement(self, lens: Lens) -> Displacement:
        direction, phase = np.random.default_rng([self.seed, 0x30B]).uniform(0, 2 * np.pi, 2)
        return Swing(self.px, float(direction), lens.shape[0] / self.swings, float(phase))
