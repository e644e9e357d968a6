"""Frames of a scene in grey values: light through the lens, then the sensor's own pixels."""

from abc import ABC, abstractmethod
from functools import lru_cache
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.scene.sky import PictureScene, Scene

Light = NDArray[np.float32]
Grey = NDArray[np.uint8]
Settings = TypeVar("Settings", contravariant=True)

DARK_DOUBLING_K = 8.0
"""Warming that doubles the dark current: assumed, what silicon usually does."""


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
        optics = condition.optics
        if isinstance(scene, PictureScene):
            return _photograph(scene, scene.part(optics.columns, optics.rows), shutter)
        light = star_light(scene, optics, shutter)
        generator = None
        if condition.noise:
            # By frame time, so that a frame nobody looked at does not change the next one's noise.
            seed = [condition.seed, max(0, shutter.readout_ps)]
            generator = np.random.Generator(np.random.SFC64(seed))
        return self.counts(light, shutter.exposure_s, condition, settings, generator)

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
            condition: temperature, hot pixels and their seed.
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


def doubled(at_reference: float, temperature_c: float, reference_c: float) -> float:
    """A dark current or signal at ``temperature_c``, by what it is at ``reference_c``."""
    return float(at_reference * 2 ** ((temperature_c - reference_c) / DARK_DOUBLING_K))


@lru_cache(maxsize=8)
def hot_pixels(
    seed: int, count: int, pixels: int, mean: float = 1.0
) -> tuple[NDArray[np.int64], Light]:
    """Flat indices among ``pixels`` of ``count`` that radiation has made hot, and how hot.

    The strengths are distributed exponentially.
    """
    generator = np.random.default_rng([seed, 0x407])
    places = generator.choice(pixels, count, replace=False)
    return places, (mean * generator.exponential(size=count)).astype(np.float32)
