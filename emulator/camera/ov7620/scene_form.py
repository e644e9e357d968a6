"""Scenes of sun and nadir cameras, for tools: see ``emulator.scene.form``."""

from typing import Any

import numpy as np

from cubestack.emulator.camera.common.view import View
from cubestack.emulator.camera.ov7620.lens_error import FIELD_DEG, NOMINAL, LensError
from cubestack.emulator.camera.ov7620.scene_file import earth_sun_keys
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene import form
from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, Mounting, Reflection
from cubestack.emulator.scene.hazards.contract import SUN_RADIUS_DEG, Body
from cubestack.emulator.scene.hazards.moon import RADIUS_RAD as MOON_RADIUS_RAD
from cubestack.firmware_model.values import plain

TITLE = "the satellite's body axes at time 0; y is down"

TURN = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Puts +z, where the nadir camera usually looks, in the middle of the map, and -y on top."""

_AROUND = np.radians(np.arange(0, 360, 5))
RIM = vector_from_angles(FIELD_DEG * np.cos(_AROUND), FIELD_DEG * np.sin(_AROUND))
"""Directions (n, 3) in camera axes along the rim of the field."""

MARKS = {
    f"{sign}{axis}": float(f"{sign}1") * np.eye(3)[number]
    for number, axis in enumerate("xyz")
    for sign in "+-"
}


def earth_sun_form() -> form.SceneForm[EarthSunView]:
    """Form of a device with a sun and a nadir camera."""
    return form.SceneForm(earth_sun_keys(), _view, _table, _sky_map)


def _view(board: Any) -> EarthSunView:
    return View(board.scene.in_body_axes(), next(iter(board.cameras.values())).condition)


def _table(view: EarthSunView) -> form.Table:
    scene, condition = view.scene, view.condition
    table: form.Table = {"kind": "earth-sun"}
    for name in ("nadir", "sun", "moon"):
        if getattr(scene, name) is not None:
            table[name] = form.round_values(getattr(scene, name), form.WRITTEN_DIGITS)
    rate = np.asarray(scene.rate_deg_s, np.float64)
    if np.any(rate):
        table["rate_deg_s"] = rate.tolist()
    usual = EarthSunScene()
    table |= form.changed_fields(scene, usual, "nadir", "sun", "moon", "rate_deg_s")
    seed = table.get("seed", 0)
    table |= form.changed_fields(condition, FisheyeCondition(), "seed")
    for camera in CameraTarget:
        name = camera.name.lower()
        mounting: Mounting = getattr(scene, f"{name}_camera")
        if not np.allclose(mounting.matrix, getattr(usual, f"{name}_camera").matrix):
            table[f"{name}_camera"] = {key: plain(one) for key, one in vars(mounting).items()}
        lens: LensError | None = getattr(condition, f"{name}_lens")
        if lens is not None:
            table[f"{name}_lens"] = form.changed_fields(lens, NOMINAL, "scale", "residuals")
    if scene.reflections:
        table["reflections"] = [_reflection(one) for one in scene.reflections]
    return table | form.hazard_table((*scene.hazards, *condition.hazards), seed)


def _reflection(one: Reflection) -> form.Table:
    at = {"camera": one.camera.name.lower(), "at_deg": [one.alpha_deg, one.beta_deg]}
    return {**at, "radius_px": one.radius_px, "level": one.level}


def _sky_map(view: EarthSunView, now_ps: int) -> form.SkyMap:
    scene = view.scene
    moved = scene.moves and now_ps > 0
    bodies = [
        Body("Earth", np.asarray(scene.nadir), angular_radius_deg(scene.altitude_km)),
        Body("Sun", np.asarray(scene.sun), SUN_RADIUS_DEG),
    ]
    if scene.moon is not None:
        moon_deg = float(np.degrees(MOON_RADIUS_RAD))
        bodies.append(Body("Moon", np.asarray(scene.moon), moon_deg))
    known = {one.name for one in bodies}
    return form.SkyMap(
        TITLE,
        tuple(_camera(scene, camera, 0) for camera in CameraTarget),
        tuple(_camera(scene, camera, now_ps) for camera in CameraTarget) if moved else (),
        (*bodies, *(one for one in form.bodies_of(scene.hazards) if one.name not in known)),
        MARKS,
        turn=TURN,
    )


def _camera(scene: EarthSunScene, camera: CameraTarget, time_ps: int) -> form.CameraField:
    axes: form.Matrix = scene.axes(camera, time_ps)
    return form.CameraField(f"{camera.name.lower()} camera", axes, RIM @ axes)
