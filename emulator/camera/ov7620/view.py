"""Properties of sun and nadir cameras, and what they see."""

from dataclasses import dataclass

from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import Lens, SensorHazard
from cubestack.emulator.camera.common.view import TEMPERATURES_C, View
from cubestack.emulator.camera.ov7620.lens_error import LensError
from cubestack.emulator.camera.ov7620.luminance import F_NUMBER, PITCH_UM, SPOT_PX
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.interface.cameras.ov7620 import COLUMNS, ROWS
from cubestack.firmware_model.values import DeclaredValues, flag, number, positive, whole

MOST_STUCK = ROWS * COLUMNS // 4
"""Largest number of single pixels and pairs, so that each finds a place."""

IN_FOCUS = Lens(F_NUMBER, PITCH_UM, (ROWS, COLUMNS), ((COLUMNS - 1) / 2, (ROWS - 1) / 2), SPOT_PX)
"""The part of the lens that hazards can change."""


@dataclass(frozen=True)
class FisheyeCondition(DeclaredValues):
    """Properties of a camera with a fisheye lens.

    The Sun's image ends where its level crosses from background to object at the published
    exposure; the CubeSense thesis has 8 px and 6 px, between which the default is chosen.
    """

    error = SceneError

    bloom_px: float = positive(7.0, "radius of the Sun's image on the boresight")
    hot_pixels: int = whole(0, "pixels of each camera that are stuck at full scale", 0)
    hot_pairs: int = whole(0, "pairs of such pixels, side by side", 0)
    noise: bool = flag(True, "false: no noise, but for hot pixels")
    seed: int = whole(0, "of noise and hot pixels", 0)
    #: nadir_lens, sun_lens: errors of a camera's lens; None: those of the unit
    nadir_lens: LensError | None = None
    sun_lens: LensError | None = None
    temperature_c: float = number(
        20.0, "of lenses and sensors; only hazards depend on it", *TEMPERATURES_C
    )
    hazards: tuple[SensorHazard, ...] = ()  #: faults of lenses and sensors, drawn for each camera

    def __post_init__(self) -> None:
        super().__post_init__()
        effects.lens(IN_FOCUS, self.hazards, self.temperature_c)
        if self.hot_count + self.hot_pairs > MOST_STUCK:
            raise SceneError(
                f"hot_pixels and hot_pairs must be at most {MOST_STUCK} together, "
                f"not {self.hot_count + self.hot_pairs}"
            )

    @property
    def hot_count(self) -> int:
        """Number of single stuck pixels, including those of the hazards."""
        return self.hot_pixels + effects.hot_pixels(self.hazards)


EarthSunView = View[EarthSunScene, FisheyeCondition]
