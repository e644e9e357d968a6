"""Frames of a scene in grey values: light through the lens, then the sensor's own pixels."""

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import Exposure
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.scene.sky import PictureScene, Scene

Light = NDArray[np.float32]
Grey = NDArray[np.uint8]
Settings = TypeVar("Settings", contravariant=True)


class Imager(ABC, Generic[Settings]):
    """Renders frames; the same arguments give the same picture, whatever else was rendered."""

    def picture(
        self, scene: Scene, condition: SkyCondition, shutter: RollingShutter, settings: Settings
    ) -> Grey:
        """Grey values (rows, columns), C-contiguous.

        Args:
            scene: what there is to see.
            condition: what lens and sensor are like.
            shutter: when its rows are exposed; row 0 is the sensor's first.
            settings: what the sensor's registers ask for.
        """
        optics = condition.lens
        shape = optics.rows, optics.columns
        exposure = self.exposure(shape, shutter.exposure_s, condition, settings)
        # By frame time, so that a frame nobody looked at does not change the next one's noise.
        seed = [condition.seed, max(0, shutter.readout_ps)]
        if isinstance(scene, PictureScene):
            pixels = _photograph(scene, scene.part(optics.columns, optics.rows), shutter)
            return effects.on_picture(pixels, condition.hazards, exposure, seed)
        light = effects.on_light(
            star_light(scene, optics, shutter), condition.hazards, exposure, seed
        )
        generator = None
        if condition.noise:
            generator = np.random.Generator(np.random.SFC64(seed))
        return self.counts(light, shutter.exposure_s, condition, settings, generator)

    def exposure(
        self, shape: tuple[int, int], seconds: float, condition: SkyCondition, settings: Settings
    ) -> Exposure:
        """What hazards may know of a frame of ``shape`` (rows, columns)."""
        return Exposure(
            shape,
            condition.optics.pixel_pitch_um,
            seconds,
            condition.temperature_c,
            self.electrons_per_count(settings),
        )

    @abstractmethod
    def electrons_per_count(self, settings: Settings) -> float:
        """Charge of one grey value of 8 bits at the gain that ``settings`` ask for."""

    @abstractmethod
    def counts(
        self,
        light: Light,
        exposure_s: float,
        condition: SkyCondition,
        settings: Settings,
        generator: np.random.Generator | None,
    ) -> Grey:
        """Grey values, shape as ``light``.

        Args:
            light: mean number of electrons that it frees in each pixel, shape (rows, columns).
            exposure_s: exposure of each pixel.
            condition: temperature, hot pixels and their seed, hazards.
            settings: as of ``picture``.
            generator: source of this frame's noise; None for a sensor without noise and defects.
        """


def _photograph(scene: PictureScene, pixels: Grey, shutter: RollingShutter) -> Grey:
    """A picture's ``pixels``, scaled where its own exposure is known."""
    scale = shutter.relative_exposure
    if scene.exposure_ms is not None:
        scale = 1000 * shutter.exposure_s / scene.exposure_ms
    if scale == 1:
        return pixels
    scaled: Light = np.clip(pixels * np.float32(scale), 0, 255)
    return scaled.astype(np.uint8)
