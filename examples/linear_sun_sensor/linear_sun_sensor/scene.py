"""What SunSlit sees: the Sun at an angle. Scene files have ``kind = "sun-slit"`` and these keys."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cubestack.emulator.scene.file import SceneError, read_scene_file
from cubestack.emulator.scene.form import Field, SceneForm, Sight, differing
from cubestack.emulator.scene.hazards.contract import SUN_RADIUS_DEG, Body
from cubestack.firmware_model.values import (
    DeclaredValues,
    described,
    flag,
    number,
    read_table,
    whole,
)


@dataclass(frozen=True)
class SlitScene(DeclaredValues):
    """The Sun in the plane of boresight and array; SceneError for values out of their limits."""

    error = SceneError

    sun_deg: float = number(
        12.0, "from the boresight, in the plane of the array, positive to the last pixel", -90, 90
    )
    brightness: float = number(1.0, "of the Sun at 1 au", 0, 100)
    noise: bool = flag(True, "whether pixels have any")
    seed: int = whole(0, "of the noise", 0, 2**32)


def load_scene(path: Path) -> SlitScene:
    """The scene that a TOML file describes; SceneError names the key that is wrong."""
    kinds = {"sun-slit": lambda table: SlitScene(**read_table(table, SlitScene.declared()))}
    return read_scene_file(path, kinds, '"sun-slit"')


def scene_form() -> SceneForm[SlitScene]:
    """For tools: the keys, the table of a scene, and where it is on a map of the sky."""
    keys = {"sun-slit": described(SlitScene.declared())}
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
