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
    [hazards.clouds]               # see docs/scene-keys.md
    contrast = 0.8

Directions are in scene axes, the satellite's body axes at time 0. Each key goes to the scene or to
the cameras' condition, whichever has it; ``seed`` to both.
The ball of the nadir sensor's bench is another kind, "ball", with the arguments of ``ball_scene``.
"""

from pathlib import Path
from typing import Any

from cubestack.emulator.camera.common.scene_file import hazard_tables, read_hazards
from cubestack.emulator.camera.ov7620.fisheye import check_field
from cubestack.emulator.camera.ov7620.lens_error import LensError
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene import file, keys
from cubestack.emulator.scene.ball import DISTANCE_MM, RADIUS_MM, ball_scene
from cubestack.emulator.scene.earth_sun import (
    FASTEST_DEG_S,
    EarthSunScene,
    Mounting,
    Reflection,
    Target,
)
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


_VECTOR = file.several(3, file.number)
_MOUNTING = file.subtable(
    {
        "boresight": _VECTOR.told("direction, body axes"),
        "right": _VECTOR.told("direction that the picture's rows follow, body axes"),
    },
    Mounting,
)


def _mounting(value: Any) -> Mounting:
    values = _MOUNTING(value)
    if "boresight" not in values:
        raise file.SceneError("needs the key boresight")
    return Mounting(**values)


_PAIRS = file.list_of(file.several(2, file.number))


def _radial(value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list):
        raise file.SceneError(f"must be pairs of field angle and error, not {value!r}")
    return _PAIRS(value)


_LENS = file.subtable(
    {
        "centre_px": file.several(2, file.number).told("optical axis less the boresight"),
        "radial_deg": file.Reader(_radial, _PAIRS.about).told(
            "pairs of field angle, and error outwards there"
        ),
        "decentring_deg": file.several(2, file.number).told("Brown's p1 and p2"),
    },
    LensError,
)


def _lens(value: Any) -> LensError:
    return LensError(**_LENS(value))


_REFLECTION = file.subtable(
    {
        "camera": file.one_of({camera.name.lower(): camera for camera in Target}).told("that sees"),
        "at_deg": file.several(2, file.number).told("its angles alpha and beta"),
        "radius_px": file.number.told("its size", low=0),
        "level": file.number.told("grey values above black", low=0),
    }
)


def _reflections(value: Any) -> tuple[Reflection, ...]:
    if not isinstance(value, list):
        raise file.SceneError("must be tables, each under [[reflections]]")
    return tuple(_reflection(_REFLECTION(item)) for item in value)


def _reflection(values: dict[str, Any]) -> Reflection:
    if missing := _REFLECTION.about["readers"].keys() - values.keys():
        raise file.SceneError(f"needs the keys {', '.join(sorted(missing))}")
    alpha, beta = values.pop("at_deg")
    check_field(alpha, beta)
    return Reflection(alpha_deg=alpha, beta_deg=beta, **values)


def _mounted(boresight: str) -> file.Reader[Mounting]:
    return file.Reader(_mounting, _MOUNTING.about).told(f"how it is mounted; else {boresight}")


_OWN_LENS = file.Reader(_lens, _LENS.about).told("how it differs from the firmware's polynomial")
_PAIR = file.several(2, file.number)
_RATE = file.number.told(low=-FASTEST_DEG_S, high=FASTEST_DEG_S)
_SCENE: file.Readers = {
    "nadir": _VECTOR.told("direction of the Earth's centre", role="direction"),
    "nadir_deg": _PAIR.told("its angles in the nadir camera", instead=["nadir"]),
    "sun": _VECTOR.told("direction of the Sun", role="direction"),
    "sun_deg": _PAIR.told("its angles in the Sun camera", instead=["sun"]),
    "moon": _VECTOR.told("direction of the Moon; without it there is none", role="direction"),
    "altitude_km": file.number.told("of the satellite"),
    "rate_deg_s": file.several(3, _RATE).told("body rate in body axes"),
    "nadir_camera": _mounted("+z"),
    "sun_camera": _mounted("-z"),
    "nadir_lens": _OWN_LENS,
    "sun_lens": _OWN_LENS,
    "bloom_px": file.number.told("radius of the Sun's image on the boresight", low=0),
    "unevenness": file.number.told("standard deviation of the Earth's brightness, relative"),
    "glow_km": file.number.told("scale height of the glow above the limb; 0 for none"),
    "reflections": file.Reader(_reflections, {**_REFLECTION.about, "type": "tables"}).told(
        "false lights"
    ),
    "temperature_c": file.number.told("of lenses and sensors; only hazards depend on it"),
    "hot_pixels": file.whole.told("pixels of each camera that are stuck at full scale", low=0),
    "hot_pairs": file.whole.told("pairs of such pixels, side by side", low=0),
    "noise": file.flag.told("false: no noise, but for hot pixels"),
    "seed": file.whole.told("of noise, surface and hot pixels", low=0),
    "hazards": hazard_tables(EARTH_HAZARDS),
}
_BALL_SCENE: file.Readers = {
    "angle_deg": _PAIR.told("alpha and beta that the stage is turned to", default=[0.0, 0.0]),
    "radius_mm": file.number.told("of the ball", default=RADIUS_MM, low=0),
    "distance_mm": file.number.told("of its surface from the axis", default=DISTANCE_MM, low=0),
    "offset_mm": _VECTOR.told("of the optic point from the axis", default=[0.0, 0.0, 0.0]),
    "unevenness": file.number.told("of the ball's brightness, relative", default=0.0),
    "seed": _SCENE["seed"],
}
_BALL: file.Readers = {
    **_BALL_SCENE,
    **{key: _SCENE[key] for key in ("nadir_lens", "hot_pixels", "hot_pairs", "noise")},
}


def earth_sun_keys() -> dict[str, Any]:
    """What the keys of each kind are (`keys.declared`)."""
    owners = EarthSunScene, FisheyeCondition
    return {"earth-sun": keys.declared(_SCENE, *owners), "ball": keys.declared(_BALL, *owners)}
