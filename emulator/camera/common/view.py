"""What a camera sees and what it is like: scenes know no sensor, conditions know no scene."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.scene.file import SceneError, refuse_negative
from cubestack.emulator.scene.sky import Scene

S = TypeVar("S")
C = TypeVar("C")


@dataclass(frozen=True, eq=False)
class View(Generic[S, C]):
    """A scene, and the condition of the camera that looks at it: what a scene file gives.

    It can be assigned wherever a scene can; the camera then takes over both.
    """

    scene: S
    condition: C


@dataclass(frozen=True)
class SkyCondition:
    """What a camera that looks at the sky is like.

    Attributes:
        optics: the lens.
        noise: False makes the sensor ideal: no noise, no dark current, no defects.
        seed: of noise and hot pixels.
        temperature_c: of the sensor, -60 to 125.
        hot_pixels: number of pixels that radiation has made hot since the sensor left the factory.
    """

    optics: Optics
    noise: bool = True
    seed: int = 0
    temperature_c: float = 20.0
    hot_pixels: int = 20

    def __post_init__(self) -> None:
        """Refuse what can not be."""
        refuse_negative(self, "hot_pixels", "seed")
        pixels = self.optics.columns * self.optics.rows
        if self.hot_pixels > pixels:
            raise SceneError(f"hot_pixels must be at most {pixels}, not {self.hot_pixels}")
        if not -60 <= self.temperature_c <= 125:
            raise SceneError(f"temperature_c must be in -60..125, not {self.temperature_c}")


SkyView = View[Scene, SkyCondition]
