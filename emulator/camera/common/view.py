"""What a camera sees and what it is like: scenes know no sensor, conditions know no scene."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Generic, TypeVar

from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
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


TEMPERATURES_C = (-60.0, 125.0)
"""That sensors work at."""


def check_temperature(temperature_c: float) -> None:
    """Raise SceneError for a temperature that no sensor works at."""
    low, high = TEMPERATURES_C
    if not low <= temperature_c <= high:
        raise SceneError(f"temperature_c must be in {low:g}..{high:g}, not {temperature_c}")


@dataclass(frozen=True)
class SkyCondition:
    """What a camera that looks at the sky is like.

    Attributes:
        optics: the lens.
        noise: False makes the sensor ideal: no noise, no dark current, no defects.
        seed: of noise and hot pixels.
        temperature_c: of the sensor, -60 to 125.
        hot_pixels: number of pixels that radiation has made hot since the sensor left the factory.
        hazards: what else is wrong with lens and sensor.
    """

    optics: Optics
    noise: bool = True
    seed: int = 0
    temperature_c: float = 20.0
    hot_pixels: int = 20
    hazards: tuple[SensorHazard, ...] = ()

    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {"temperature_c": TEMPERATURES_C}

    def __post_init__(self) -> None:
        """Refuse what can not be."""
        refuse_negative(self, "hot_pixels", "seed")
        pixels = self.optics.columns * self.optics.rows
        if self.hot_count > pixels:
            raise SceneError(f"hot_pixels must be at most {pixels}, not {self.hot_count}")
        check_temperature(self.temperature_c)
        effects.lens(self.optics.basics, self.hazards, self.temperature_c)

    @property
    def hot_count(self) -> int:
        """All hot pixels, those of the hazards included."""
        return self.hot_pixels + effects.hot(self.hazards)

    @cached_property
    def lens(self) -> Optics:
        """The optics as the hazards make them; the firmware is told of no change."""
        return self.optics.changed(
            effects.lens(self.optics.basics, self.hazards, self.temperature_c)
        )


SkyView = View[Scene, SkyCondition]
