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
    """A scene and the condition of the camera that looks at it: the contents of a scene file.

    It can be assigned wherever a scene can; the camera then takes both.
    """

    scene: S
    condition: C


TEMPERATURES_C = (-60.0, 125.0)
"""Range in which sensors work."""


@dataclass(frozen=True)
class SkyCondition(DeclaredValues):
    """Properties of a camera that looks at the sky."""

    error = SceneError

    optics: Optics  #: the lens
    noise: bool = flag(True, "false: no shot, dark and read noise, no defects")
    seed: int = whole(0, "of noise and hot pixels", 0)
    temperature_c: float = number(
        20.0, "of the sensor; the dark current doubles every 8 degrees", *TEMPERATURES_C
    )
    hot_pixels: int = whole(20, "pixels made hot by radiation", 0)
    hazards: tuple[SensorHazard, ...] = ()  #: faults of lens and sensor

    def __post_init__(self) -> None:
        super().__post_init__()
        pixels = self.optics.columns * self.optics.rows
        if self.hot_count > pixels:
            raise SceneError(f"hot_pixels must be at most {pixels}, not {self.hot_count}")
        effects.lens(self.optics.basics, self.hazards, self.temperature_c)

    @property
    def hot_count(self) -> int:
        """Number of hot pixels, including those of the hazards."""
        return self.hot_pixels + effects.hot_pixels(self.hazards)

    @cached_property
    def lens(self) -> Optics:
        """The optics with the changes by hazards, of which the firmware does not know."""
        return self.optics.changed(
            effects.lens(self.optics.basics, self.hazards, self.temperature_c)
        )


SkyView = View[Scene, SkyCondition]
