"""What SunSlit sees: the Sun at an angle. Scene files have ``kind = "sun-slit"`` and these keys."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cubestack.emulator.scene import file
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.form import Field, SceneForm, Sight, differing
from cubestack.emulator.scene.hazards.contract import SUN_RADIUS_DEG, Body
from cubestack.emulator.scene.keys import declared


@dataclass(frozen=True)
class SlitScene:
    """The Sun in the plane of boresight and array.

    Attributes:
        sun_deg: from the boresight, -90 to 90, positive towards the last pixel.
        brightness: of the Sun at 1 au, 0 to 100.
        noise: whether pixels have any.
        seed: of it.
    """

    LIMITS: ClassVar = {"sun_deg": (-90, 90), "brightness": (0, 100), "seed": (0, 2**32)}

    sun_deg: float = 12.0
    brightness: float = 1.0
    noise: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what can not be; SceneError names it."""
        for name, (low, high) in self.LIMITS.items():
            if not low <= getattr(self, name) <= high:
                raise SceneError(f"{name} must be {low} to {high}, not {getattr(self, name):g}")


_KEYS = {
    "sun_deg": file.number.told("from the boresight, in the plane of the array"),
    "brightness": file.number.told("of the Sun at 1 au"),
    "noise": file.flag.told("whether pixels have any"),
    "seed": file.whole.told("of the noise"),
}


def load_scene(path: Path) -> SlitScene:
    """The scene that a TOML file describes; SceneError names the key that is wrong."""
    kinds = {"sun-slit": lambda table: SlitScene(**file.read_table(table, _KEYS))}
    return file.read_scene_file(path, kinds, '"sun-slit"')


def scene_form() -> SceneForm[SlitScene]:
    """For tools: the keys, the table of a scene, and where it is on a map of the sky."""
    keys = {"sun-slit": declared(_KEYS, SlitScene)}
    return SceneForm(keys, lambda board: board.scene, _table, _sight)


def _table(scene: SlitScene) -> dict[str, Any]:
    return {"kind": "sun-slit"} | differing(scene, SlitScene())


def _sight(scene: SlitScene, _now_ps: int) -> Sight:
    angles = np.radians([scene.sun_deg, *range(-45, 46, 5)])  # of the Sun, and across the field
    sun, *field = np.transpose([np.sin(angles), 0 * angles, np.cos(angles)])
    array = Field("array", np.eye(3), np.array(field))
    turn = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # the boresight in the map's middle
    bodies = (Body("Sun", sun, SUN_RADIUS_DEG),)
    return Sight("the sensor's axes", (array,), bodies=bodies, turn=turn)
