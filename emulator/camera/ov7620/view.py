"""What a sun or nadir camera is like, and what it sees."""

from dataclasses import dataclass
from typing import ClassVar

from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import Lens, SensorHazard
from cubestack.emulator.camera.common.view import TEMPERATURES_C, View, check_temperature
from cubestack.emulator.camera.ov7620.lens_error import LensError
from cubestack.emulator.camera.ov7620.luminance import F_NUMBER, PITCH_UM, SPOT_PX
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.file import SceneError, refuse_negative, refuse_zero
from cubestack.firmware_model.interface.cameras.ov7620 import COLUMNS, ROWS

MOST_STUCK = ROWS * COLUMNS // 4
"""Single pixels and pairs that find a place each."""

IN_FOCUS = Lens(F_NUMBER, PITCH_UM, (ROWS, COLUMNS), SPOT_PX)
"""What hazards may change of the lens."""


@dataclass(frozen=True)
class FisheyeCondition:
    """What a camera behind a fisheye is like.

    Attributes:
        bloom_px: radius of the Sun's image on the boresight of the sun camera at the published
            exposure, where its level crosses from background to object (CubeSense thesis: 8 px).
        hot_pixels: pixels of each camera that are stuck at full scale.
        hot_pairs: pairs of such pixels, side by side.
        noise: False makes the sensor ideal but for its hot pixels.
        seed: of noise and hot pixels.
        nadir_lens, sun_lens: what is particular to a camera's lens; None: the unit's own.
        temperature_c: of lens and sensor, -60 to 125; only hazards depend on it.
        hazards: what else is wrong with lenses and sensors, drawn for each camera.
    """

    bloom_px: float = 7.0  # chosen between the published 8 and 6
    hot_pixels: int = 0
    hot_pairs: int = 0
    noise: bool = True
    seed: int = 0
    nadir_lens: LensError | None = None
    sun_lens: LensError | None = None
    temperature_c: float = 20.0
    hazards: tuple[SensorHazard, ...] = ()

    LIMITS: ClassVar[dict[str, tuple[float, float]]] = {"temperature_c": TEMPERATURES_C}

    def __post_init__(self) -> None:
        """Refuse what can not be."""
        refuse_zero(self, "bloom_px")
        refuse_negative(self, "hot_pixels", "hot_pairs", "seed")
        check_temperature(self.temperature_c)
        effects.lens(IN_FOCUS, self.hazards, self.temperature_c)
        if self.hot_count + self.hot_pairs > MOST_STUCK:
            raise SceneError(
                f"hot_pixels and hot_pairs must be at most {MOST_STUCK} together, "
                f"not {self.hot_count + self.hot_pairs}"
            )

    @property
    def hot_count(self) -> int:
        """All single stuck pixels, those of the hazards included."""
        return self.hot_pixels + effects.hot(self.hazards)


EarthSunView = View[EarthSunScene, FisheyeCondition]
