"""Renders frames of a scene as grey values: light through the lens, then the sensor's pixels."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import Exposure
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import Grey, Light, PixelModel, grey_values
from cubestack.emulator.scene.sky import PictureScene, Scene

Settings = TypeVar("Settings", contravariant=True)


class Imager(ABC, Generic[Settings]):
    """Renders frames; an image depends only on the arguments."""

    def render(
        self, scene: Scene, condition: SkyCondition, shutter: RollingShutter, settings: Settings
    ) -> Grey:
        """Grey values (rows, columns), C-contiguous.

        Args:
            scene: the scene.
            condition: state of lens and sensor.
            shutter: exposure of the rows; row 0 is the sensor's first.
            settings: settings from the sensor's registers.
        """
        optics = condition.lens
        shape = optics.rows, optics.columns
        exposure = self.exposure(shape, shutter.exposure_s, condition, settings)
        # By frame time, so that the noise of a frame does not depend on which ones were rendered.
        seed = [condition.seed, max(0, shutter.readout_ps)]
        if isinstance(scene, PictureScene):
            pixels = _photograph(scene, scene.part(optics.columns, optics.rows), shutter)
            return effects.disturb_photograph(pixels, condition.hazards, exposure, seed)
        light = effects.disturb_light(
            star_light(scene, optics, shutter), condition.hazards, exposure, seed
        )
        noise = FrameNoise(seed) if condition.noise else None
        return self.counts(light, shutter.exposure_s, condition, settings, noise)

    def exposure(
        self, shape: tuple[int, int], seconds: float, condition: SkyCondition, settings: Settings
    ) -> Exposure:
        """Data of a frame of ``shape`` (rows, columns) for hazards."""
        return Exposure(
            shape,
            condition.optics.pixel_pitch_um,
            seconds,
            condition.temperature_c,
            self.electrons_per_count(settings),
        )

    @abstractmethod
    def electrons_per_count(self, settings: Settings) -> float:
        """Charge of one grey value of 8 bits at the gain in ``settings``."""

    def counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: Settings,
        noise: FrameNoise | None,
    ) -> Grey:
        """Grey values (rows, columns) of ``light``, mean numbers of electrons; see `pixels`."""
        rows, columns = light.shape
        model = self.pixels((rows, columns), exposure_s, condition, settings, noise)
        return grey_values(light, model)

    @abstractmethod
    def pixels(
        self,
        shape: tuple[int, int],
        exposure_s: float,
        condition: SkyCondition,
        settings: Settings,
        noise: FrameNoise | None,
    ) -> PixelModel:
        """The sensor's pixels in one frame, for light in electrons.

        Args:
            shape: rows and columns.
            exposure_s: exposure of each pixel.
            condition: temperature, hot pixels and their seed, hazards.
            settings: as for ``render``.
            noise: of this frame; None for a sensor without noise and defects.
        """


def _photograph(scene: PictureScene, pixels: Grey, shutter: RollingShutter) -> Grey:
    """A photograph's ``pixels``, scaled by the exposure if its own is known."""
    scale = shutter.relative_exposure
    if scene.exposure_ms is not None:
        scale = 1000 * shutter.exposure_s / scene.exposure_ms
    if scale == 1:
        return pixels
    scaled: Light = np.clip(pixels * np.float32(scale), 0, 255)
    return scaled.astype(np.uint8)
