"""Scene files for sun and nadir cameras: TOML, every key but ``kind`` may be left out::

    kind = "earth-sun"
    altitude_km = 750.0
    nadir = [0.0, 0.0, 1.0]        # towards the Earth's centre; or, as the nadir camera sees it at
                                   # time 0, nadir_deg = [alpha, beta]
    sun = [0.0, 0.0, -1.0]         # or, as the sun camera sees it, sun_deg = [alpha, beta]
    moon = [1.0, 0.0, 0.0]         # leave out for none
    rate_deg_s = [0.0, 0.1, 0.0]   # body rate in body axes
    bloom_px = 7.0                 # radius of the Sun's image
    [nadir_camera]
    boresight = [0.0, 0.0, 1.0]    # in body axes
    right = [1.0, 0.0, 0.0]
    [nadir_lens]                   # how it differs from the firmware's polynomial
    centre_px = [0.3, -0.2]        # optical axis beside the boresight
    radial_deg = [[40.0, 0.1], [70.0, 0.4]]  # field angles, and errors outwards there
    decentring_deg = [0.0, 0.05]   # Brown's p1 and p2
    [[reflections]]
    camera = "sun"
    at_deg = [20.0, -10.0]         # alpha and beta
    radius_px = 4.0
    level = 200.0                  # grey values above black
    [hazards.clouds]               # see docs/scenes.md
    contrast = 0.8

Directions are in scene axes, the satellite's body axes at time 0. Each key goes to the scene or to
the cameras' condition, whichever has it; ``seed`` to both.
The ball of the nadir sensor's bench is another kind, "ball", with the arguments of ``ball_scene``.
"""

from pathlib import Path
from typing import Any

from cubestack.emulator.camera.common.scene_file import read_hazards
from cubestack.emulator.camera.ov7620.fisheye import check_field
from cubestack.emulator.camera.ov7620.lens_error import LensError
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene import file
from cubestack.emulator.scene.ball import ball_scene
from cubestack.emulator.scene.earth_sun import EarthSunScene, Mounting, Reflection, Target
from cubestack.emulator.scene.hazards import EARTH_HAZARDS


def load_earth_sun_scene(path: Path) -> EarthSunView:
    """What the TOML file ``path`` gives; SceneError names the key that is wrong."""
    kinds = {"earth-sun": _view, "ball": _ball}
    return file.read_scene_file(path, kinds, '"earth-sun" or "ball" for a sun and nadir sensor')


def _ball(table: dict[str, Any]) -> EarthSunView:
    values = file.read_table(table, _BALL)
    condition = FisheyeCondition(**file.values_for(FisheyeCondition, values))
    scene = ball_scene(**{key: values[key] for key in _BALL_SCENE if key in values})
    return EarthSunView(scene, condition)


def _view(table: dict[str, Any]) -> EarthSunView:
    values = file.read_table(table, _SCENE)
    angles = {f"{name}_deg": values.pop(f"{name}_deg", None) for name in ("sun", "nadir")}
    for name in ("sun", "nadir"):
        if name in values and angles[f"{name}_deg"]:
            raise file.SceneError(f"give either {name} or {name}_deg, not both")
    light, of_sensor = read_hazards(values, EARTH_HAZARDS)
    condition = FisheyeCondition(**file.values_for(FisheyeCondition, values), hazards=of_sensor)
    values = file.values_for(EarthSunScene, values)
    return EarthSunView(EarthSunScene.facing(**angles, **values, hazards=light), condition)


def _mounting(value: Any) -> Mounting:
    values = file.subtable(
        {"boresight": file.several(3, file.number), "right": file.several(3, file.number)}
    )(value)
    if "boresight" not in values:
        raise file.SceneError("needs the key boresight")
    return Mounting(**values)


def _lens(value: Any) -> LensError:
    return LensError(**file.subtable(_LENS)(value))


def _radial(value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list):
        raise file.SceneError(f"must be pairs of field angle and error, not {value!r}")
    return tuple(file.several(2, file.number)(pair) for pair in value)


def _reflections(value: Any) -> tuple[Reflection, ...]:
    if not isinstance(value, list):
        raise file.SceneError("must be tables, each under [[reflections]]")
    return tuple(_reflection(file.subtable(_REFLECTION)(item)) for item in value)


def _reflection(values: dict[str, Any]) -> Reflection:
    if missing := _REFLECTION.keys() - values.keys():
        raise file.SceneError(f"needs the keys {', '.join(sorted(missing))}")
    alpha, beta = values.pop("at_deg")
    check_field(alpha, beta)
    return Reflection(alpha_deg=alpha, beta_deg=beta, **values)


_REFLECTION: file.Readers = {
    "camera": file.one_of({camera.name.lower(): camera for camera in Target}),
    "at_deg": file.several(2, file.number),
    "radius_px": file.number,
    "level": file.number,
}
_LENS: file.Readers = {
    "centre_px": file.several(2, file.number),
    "radial_deg": _radial,
    "decentring_deg": file.several(2, file.number),
}
_SCENE: file.Readers = {
    "nadir": file.several(3, file.number),
    "nadir_deg": file.several(2, file.number),
    "sun": file.several(3, file.number),
    "sun_deg": file.several(2, file.number),
    "moon": file.several(3, file.number),
    "altitude_km": file.number,
    "rate_deg_s": file.several(3, file.number),
    "nadir_camera": _mounting,
    "sun_camera": _mounting,
    "nadir_lens": _lens,
    "sun_lens": _lens,
    "bloom_px": file.number,
    "unevenness": file.number,
    "glow_km": file.number,
    "reflections": _reflections,
    "temperature_c": file.number,
    "hot_pixels": file.whole,
    "hot_pairs": file.whole,
    "noise": file.flag,
    "seed": file.whole,
    "hazards": lambda value: value,
}
_BALL_SCENE: file.Readers = {
    "angle_deg": file.several(2, file.number),
    "radius_mm": file.number,
    "distance_mm": file.number,
    "offset_mm": file.several(3, file.number),
    "unevenness": file.number,
    "seed": file.whole,
}
_BALL = _BALL_SCENE | {
    key: _SCENE[key] for key in ("nadir_lens", "hot_pixels", "hot_pairs", "noise")
}
