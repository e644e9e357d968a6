"""Scene files for sun and nadir cameras: TOML, every key except ``kind`` is optional::

    kind = "earth-sun"
    altitude_km = 750.0
    nadir = [0.0, 0.0, 1.0]        # towards the Earth's centre; or, as the nadir camera sees it at
                                   # time 0, nadir_deg = [alpha, beta]
    sun = [0.0, 0.0, -1.0]         # or, as the sun camera sees it, sun_deg = [alpha, beta]
    moon = [1.0, 0.0, 0.0]         # if omitted, there is none
    rate_deg_s = [0.0, 0.1, 0.0]   # body rate in body axes
    bloom_px = 7.0                 # radius of the Sun's image
    [nadir_camera]
    boresight = [0.0, 0.0, 1.0]    # in body axes
    right = [1.0, 0.0, 0.0]
    [nadir_lens]                   # its differences from the firmware's polynomial
    centre_px = [0.3, -0.2]        # optical axis minus boresight
    radial_deg = [[40.0, 0.1], [70.0, 0.4]]  # field angles and outward errors there
    decentring_deg = [0.0, 0.05]   # Brown's p1 and p2
    [[reflections]]
    camera = "sun"
    at_deg = [20.0, -10.0]         # alpha and beta
    radius_px = 4.0
    level = 200.0                  # grey values above black
    [hazards.clouds]               # see docs/reference/scene-keys.md
    contrast = 0.8

Directions are in scene axes, the satellite's body axes at time 0. Each key belongs to the scene or
to the cameras' condition; ``seed`` to both. The ball of the nadir sensor's test bench is another
kind, "ball", with the arguments of ``ball_scene``.
"""

from pathlib import Path
from typing import Any

from cubestack.emulator.camera.common.scene_file import hazard_tables, split_hazards
from cubestack.emulator.camera.ov7620.fisheye import check_field
from cubestack.emulator.camera.ov7620.lens_error import LensError
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import BALL, EarthSunScene, Mounting, Reflection, ball_scene
from cubestack.emulator.scene.file import SceneError, read_scene_file, values_for
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, SKY_HAZARDS
from cubestack.firmware_model import values as declare


def load_earth_sun_scene(path: Path) -> EarthSunView:
    """Read a scene file; SceneError names the wrong key."""
    kinds = {"earth-sun": _view, "ball": _ball}
    return read_scene_file(path, kinds, '"earth-sun" or "ball" for a sun and nadir sensor')


def _ball(given: dict[str, Any]) -> EarthSunView:
    values = declare.read_table(given, _BALL)
    condition = FisheyeCondition(**values_for(FisheyeCondition, values))
    scene = ball_scene(**{key: values[key] for key in BALL if key in values})
    return EarthSunView(scene, condition)


def _view(given: dict[str, Any]) -> EarthSunView:
    values = declare.read_table(given, _scene_keys(given.get("seed", 0)))
    angles = {f"{name}_deg": values.pop(f"{name}_deg", None) for name in ("sun", "nadir")}
    for name in ("sun", "nadir"):
        if name in values and angles[f"{name}_deg"]:
            raise SceneError(f"give either {name} or {name}_deg, not both")
    light, of_sensor = split_hazards(values.pop("hazards", ()))
    condition = FisheyeCondition(**values_for(FisheyeCondition, values), hazards=of_sensor)
    values = values_for(EarthSunScene, values)
    return EarthSunView(EarthSunScene.facing(**angles, **values, hazards=light), condition)


_REFLECTION: declare.Keys = {
    **{name: Reflection.declared()[name] for name in ("camera", "radius_px", "level")},
    "at_deg": declare.vector(2, declare.REQUIRED, "its angles alpha and beta"),
}


def _reflection(values: dict[str, Any]) -> Reflection:
    alpha, beta = values.pop("at_deg")
    check_field(alpha, beta)
    return Reflection(alpha_deg=alpha, beta_deg=beta, **values)


def _own_lens(camera: str) -> Any:
    keys = {name: one for name, one in LensError.declared().items() if name != "scale"}
    meaning = f"differences of the {camera} camera's lens from the firmware's polynomial"
    return declare.table(None, meaning, keys, lambda values: LensError(**values))


def _scene_keys(seed: int = 0) -> declare.Keys:
    """``seed`` as of `hazard_tables`."""
    return {
        **EarthSunScene.declared(),
        "nadir_deg": declare.vector(2, None, "its angles in the nadir camera", instead=("nadir",)),
        "sun_deg": declare.vector(2, None, "its angles in the Sun camera", instead=("sun",)),
        "nadir_camera": declare.table(None, "its mounting; if omitted, +z", Mounting),
        "sun_camera": declare.table(None, "its mounting; if omitted, -z", Mounting),
        "nadir_lens": _own_lens("nadir"),
        "sun_lens": _own_lens("sun"),
        "reflections": declare.table((), "false lights", _REFLECTION, _reflection, array=True),
        **FisheyeCondition.declared(),
        "seed": declare.whole(0, "of noise, surface and hot pixels", 0),
        "hazards": hazard_tables({**SKY_HAZARDS, **EARTH_HAZARDS}, seed),
    }


_SCENE = _scene_keys()
_BALL: declare.Keys = {
    **BALL,
    **{key: _SCENE[key] for key in ("nadir_lens", "hot_pixels", "hot_pairs", "noise")},
    "seed": _SCENE["seed"],
}


def earth_sun_keys() -> dict[str, Any]:
    """Declared keys of each kind as JSON."""
    return {"earth-sun": declare.described(_SCENE), "ball": declare.described(_BALL)}
