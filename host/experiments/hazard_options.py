"""Hazards as an option: each random frame gets the requested ones, placed in its own sky."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubestack.emulator.camera.common.exposure import camera_state_for
from cubestack.emulator.camera.common.hazards import HAZARDS
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.ov7620.light import fisheye_state
from cubestack.emulator.camera.ov7620.view import EarthSunView
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, SKY_HAZARDS
from cubestack.emulator.scene.hazards.contract import CameraState, SkyHazard
from cubestack.emulator.scene.hazards.earth_below import EarthHazard
from cubestack.emulator.scene.hazards.hazard import Hazard
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.values import REQUIRED, ValueKind, declare, many, number


@dataclass(frozen=True)
class Asked:
    """A requested hazard."""

    name: str  #: of a hazard
    strength: float | None = None  #: on its scale; None for its usual one

    def __str__(self) -> str:
        return self.name if self.strength is None else f"{self.name}={self.strength:g}"


def _asked(given: Any) -> Asked:
    if not isinstance(given, Asked):
        raise TypeError
    return given


def _parsed(given: str) -> Asked:
    name, equals, strength = given.partition("=")
    return Asked(name, float(strength) if equals else None)


ASKED = ValueKind("hazard", "NAME or NAME=STRENGTH, as in moon or gradient=60", _asked, _parsed)


def hazard_option() -> Any:
    """The option of an experiment that takes hazards; ``check`` knows their names."""
    return many(
        (),
        "add a hazard to every random frame, e.g. moon or gradient=60; repeatable "
        "(see docs/hazards.md)",
        declare(ASKED, REQUIRED, ""),
        metavar="NAME[=STRENGTH]",
    )


def known() -> Mapping[str, type[Hazard]]:
    """All hazards of light, of sensor and lens, and of an Earth below, by name."""
    return {**SKY_HAZARDS, **EARTH_HAZARDS, **HAZARDS}


def check(asked: Sequence[Asked], *, earth: bool = False) -> None:
    """Raise ValueError for unknown hazards or strengths; hazards of the Earth need ``earth``."""
    if not asked:
        return

    kinds = {name: kind for name, kind in known().items() if earth or name not in EARTH_HAZARDS}
    for one in asked:
        if one.name not in kinds:
            raise ValueError(f"hazard: there is no {one.name!r}; known: {', '.join(sorted(kinds))}")
        scale = kinds[one.name].strength
        try:
            number(None, "", min(scale.values), max(scale.values), scale.unit).check(one.strength)
        except ValueError as error:
            raise ValueError(f"hazard: {one.name} {error}") from None


def _placed(
    asked: Sequence[Asked], state: CameraState, rng: np.random.Generator
) -> tuple[tuple[SkyHazard, ...], tuple[SensorHazard, ...]]:
    """Hazards of light, and those of sensor and lens, drawn for one frame."""
    kinds = known()
    placed = [
        kinds[one.name].sample(
            kinds[one.name].strength.usual if one.strength is None else one.strength, state, rng
        )
        for one in asked
    ]
    return tuple(hazard for hazard in placed if isinstance(hazard, SkyHazard)), tuple(
        hazard for hazard in placed if isinstance(hazard, SensorHazard)
    )


def with_hazards(
    view: SkyView, asked: Sequence[Asked], rng: np.random.Generator, time_s: float = 0.0
) -> SkyView:
    """The view of a sky with these hazards; ``time_s`` is about when it will be exposed."""
    scene, condition = view.scene, view.condition
    if not asked or not isinstance(scene, SkyScene):
        return view
    state = camera_state_for(scene.quaternion, condition.optics, time_s)
    light, sensor = _placed(asked, state, rng)
    return replace(
        view,
        scene=replace(scene, hazards=(*scene.hazards, *light)),
        condition=replace(condition, hazards=(*condition.hazards, *sensor)),
    )


def around_earth(
    view: EarthSunView, camera: CameraTarget, asked: Sequence[Asked], rng: np.random.Generator
) -> EarthSunView:
    """The view of Earth and Sun with these hazards, as far as they concern ``camera``."""
    if not asked:
        return view
    scene, condition = view.scene, view.condition
    light, sensor = _placed(asked, fisheye_state(scene, camera, 0), rng)
    light = tuple(
        hazard
        for hazard in light
        if not isinstance(hazard, EarthHazard) or camera.name.lower() in hazard.cameras
    )
    return replace(
        view,
        scene=replace(scene, hazards=(*scene.hazards, *light)),
        condition=replace(condition, hazards=(*condition.hazards, *sensor)),
    )
