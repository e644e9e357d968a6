"""What a camera sees and what it is like: scenes know no sensor, conditions know no scene."""

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.values import DeclaredValues, flag, number, whole

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


@dataclass(frozen=True)
class SkyCondition(DeclaredValues):
    """What a camera that looks at the sky is like.

    Attributes:
        optics: the lens.
        hazards: what else is wrong with lens and sensor.
    """

    error = SceneError

    optics: Optics
    noise: bool = flag(True, "false: no shot, dark and read noise, no defects")
    seed: int = whole(0, "of noise and hot pixels", 0)
    temperature_c: float = number(
        20.0, "of the sensor; 8 degrees double the dark current", *TEMPERATURES_C
    )
    hot_pixels: int = whole(20, "pixels that radiation has made hot", 0)
    hazards: tuple[SensorHazard, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what can not be: SceneError."""
        super().__post_init__()
        pixels = self.optics.columns * self.optics.rows
        if self.hot_count > pixels:
            raise SceneError(f"hot_pixels must be at most {pixels}, not {self.hot_count}")
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
