"""Scenes of cameras that look at the sky, for tools: see ``emulator.scene.form``."""

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.scene_file import sky_keys
from cubestack.emulator.camera.common.view import SkyCondition, SkyView, View
from cubestack.emulator.scene import form
from cubestack.emulator.scene.atmosphere import Atmosphere
from cubestack.emulator.scene.attitude import matrix_from_quaternion, pointing_from_matrix
from cubestack.emulator.scene.sky import Pose, Scene, SkyScene
from cubestack.firmware_model.values import plain

TITLE = "right ascension and declination, degrees"

BORDER = 24
"""Number of points along each side of a picture."""


def sky_form(
    condition: SkyCondition, uncertain: Mapping[str, float] = MappingProxyType({})
) -> form.SceneForm[SkyView]:
    """Form of a device with this default condition; arguments as of `load_scene`."""
    return form.SceneForm(
        sky_keys(condition, uncertain), _view, partial(_table, condition), _sky_map
    )


def _view(board: Any) -> SkyView:
    return View(board.camera.scene, board.camera.condition)


def _table(usual: SkyCondition, view: SkyView) -> form.Table:
    scene, condition = view.scene, view.condition
    table = _sky(scene) if isinstance(scene, SkyScene) else _picture(scene)
    seed = table.get("seed", 0)
    table |= form.changed_fields(condition, usual, "optics", "hazards", "seed")
    hazards = (*getattr(scene, "hazards", ()), *condition.hazards)
    optics = form.changed_fields(condition.optics, usual.optics, "residuals")
    return table | ({"optics": optics} if optics else {}) | form.hazard_table(hazards, seed)


def _picture(scene: Scene) -> form.Table:
    assert not isinstance(scene, SkyScene)
    table: form.Table = {"kind": "picture", "file": str(scene.file), "crop": plain(scene.crop)}
    more = {"exposure_ms": scene.exposure_ms, "quaternion": plain(scene.quaternion)}
    return table | {key: value for key, value in more.items() if value is not None}


def _sky(scene: SkyScene) -> form.Table:
    first, *later = scene.all_poses
    table: form.Table = {"kind": "sky", **_pose(first)}
    usual = SkyScene(scene.quaternion)
    table |= form.changed_fields(
        *(scene, usual), "quaternion", "rate_deg_s", "poses", "atmosphere", "hazards"
    )
    if later:
        table["poses"] = [{"at_s": pose.at_s, **_pose(pose)} for pose in later]
    air = scene.atmosphere
    if air is not None:
        needed = {"latitude_deg": air.latitude_deg, "sidereal_deg": air.sidereal_deg}
        table["atmosphere"] = needed | form.changed_fields(
            air, Atmosphere(air.latitude_deg, air.sidereal_deg)
        )
    return table


def _pose(pose: Pose) -> form.Table:
    angles = pointing_from_matrix(matrix_from_quaternion(pose.quaternion))
    found = dict(zip(("ra_deg", "dec_deg", "roll_deg"), form.round_values(angles), strict=True))
    rate = np.asarray(pose.rate_deg_s, np.float64)
    return found | ({"rate_deg_s": rate.tolist()} if np.any(rate) else {})


def _sky_map(view: SkyView, now_ps: int) -> form.SkyMap:
    scene, border = view.scene, outline(view.condition.lens)
    known = [None if (q := scene.truth(ps)) is None else _camera(q, border) for ps in (0, now_ps)]
    at_first, now = known
    moved = at_first is not None and now is not None and not np.allclose(at_first.axes, now.axes)
    return form.SkyMap(
        TITLE,
        () if at_first is None else (at_first,),
        (now,) if moved and now is not None else (),
        form.bodies_of(scene.hazards) if isinstance(scene, SkyScene) else (),
        stars=True,
    )


def _camera(quaternion: form.Matrix, border: form.Matrix) -> form.CameraField:
    axes = matrix_from_quaternion(quaternion)
    return form.CameraField("camera", axes, border @ axes)


def outline(lens: Optics) -> form.Matrix:
    """Directions (n, 3) in camera axes along the border of what a lens images on its sensor."""
    right, bottom = lens.columns - 0.5, lens.rows - 0.5
    corners = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom), (-0.5, -0.5)]
    sides = [np.linspace(a, b, BORDER, endpoint=False) for a, b in pairwise(corners)]
    border = np.concatenate(sides)
    vectors = lens.unproject(border)
    reach = np.radians(min(lens.field_stop_deg, 360.0) / 2)
    away = np.minimum(np.arccos(np.clip(vectors[:, 2], -1, 1)), reach)
    around = np.arctan2(vectors[:, 1], vectors[:, 0])
    sine = np.sin(away)
    return np.stack([sine * np.cos(around), sine * np.sin(around), np.cos(away)], axis=1)
