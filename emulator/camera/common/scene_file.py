"""Scene files for cameras that look at the sky: TOML, of one of two kinds::

    kind = "sky"
    ra_deg = 83.8                  # or quaternion = [x, y, z, w], inertial to camera, scalar last
    dec_deg = -5.4
    roll_deg = 30.0                # angle of the picture's up direction, east of north
    rate_deg_s = [0.0, 0.1, 0.0]   # body rate in camera axes: x right, y down, z out of the lens
    mag_limit = 3.8                # if omitted, all stars are visible
    mount = "earth"                # the camera turns with the Earth
    [atmosphere]                   # between camera and stars
    latitude_deg = -33.9
    sidereal_deg = 200.0           # right ascension of the zenith at time 0
    [hazards.moon]                 # see docs/reference/scene-keys.md
    direction = [90.0, -10.0]

    kind = "picture"
    file = "night.jpg"             # relative to the scene file
    crop = [0, 256]                # column and row of the first pixel used

Each key belongs to the scene or to the camera's condition; ``seed`` to both.

The camera gives the grey values of a picture unchanged, whatever exposure is set; only an undefined
frame differs, in proportion to its exposure. With ``exposure_ms``, the exposure of the picture, its
light scales with every exposure.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from cubestack.emulator.camera.common.hazards import HAZARDS as SENSOR_HAZARDS
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.scene.atmosphere import Atmosphere, earth_rate_deg_s, sidereal_deg
from cubestack.emulator.scene.attitude import ANGLES, quaternion_from_pointing
from cubestack.emulator.scene.file import SceneError, read_scene_file, values_for
from cubestack.emulator.scene.hazards import SKY_HAZARDS
from cubestack.emulator.scene.hazards.contract import SkyHazard
from cubestack.emulator.scene.hazards.hazard import Hazard, HazardTables
from cubestack.emulator.scene.sky import PictureScene, Pose, SkyScene
from cubestack.firmware_model import values as declare


def load_scene(
    path: Path, condition: SkyCondition, uncertain: Mapping[str, float] = MappingProxyType({})
) -> SkyView:
    """Read a scene file; SceneError names the wrong key.

    ``condition`` has the values of lens and sensor that the file omits, ``uncertain`` the standard
    deviations of its optics by name.
    """
    kinds = {
        "sky": lambda table: _sky(table, condition, uncertain),
        "picture": lambda table: _picture(table, Path(path).parent, condition),
    }
    return read_scene_file(path, kinds, '"sky" or "picture"')


def hazard_tables(kinds: Mapping[str, type[Hazard]], seed: int = 0) -> HazardTables:
    """The key ``hazards``, of ``kinds`` and those of any sensor and lens."""
    return HazardTables(kinds={**kinds, **SENSOR_HAZARDS}, seed=seed)


def _with_defaults(keys: declare.Keys, owner: Any) -> declare.Keys:
    return {name: replace(one, default=getattr(owner, name)) for name, one in keys.items()}


#: Keys of the table "optics"; the device gives the sensor's size.
_OPTICS: declare.Keys = {
    name: one for name, one in Optics.declared().items() if name not in ("columns", "rows")
}
_ATTITUDE: declare.Keys = {
    **ANGLES,
    "quaternion": declare.vector(
        4, None, "attitude, inertial to camera, scalar last; or the angles", instead=tuple(ANGLES)
    ),
}
_LATER: declare.Keys = {**_ATTITUDE, **Pose.declared()}
_POSE: declare.Keys = {name: one for name, one in _LATER.items() if name != "at_s"}


def _atmosphere(values: dict[str, Any]) -> Atmosphere:
    place = {key: values.pop(key) for key in ("utc", "longitude_deg") if key in values}
    if ("sidereal_deg" in values) == bool(place) or len(place) == 1:
        raise SceneError("needs either sidereal_deg, or utc and longitude_deg")
    if place:
        values["sidereal_deg"] = sidereal_deg(**place)
    return Atmosphere(**values)


_AIR: declare.Keys = {
    **Atmosphere.declared(),
    "sidereal_deg": replace(Atmosphere.declared()["sidereal_deg"], default=None),
    "longitude_deg": declare.number(None, "of the observer, east positive; with utc"),
    "utc": declare.moment(None, "date and time at time 0; with longitude_deg"),
}


def _sky_keys(
    condition: SkyCondition, uncertain: Mapping[str, float], seed: int = 0
) -> declare.Keys:
    """Arguments as of `load_scene`; ``seed`` as of `hazard_tables`."""

    def lens(values: dict[str, Any]) -> Optics:
        drawn, optics = values.pop("drawn", None), condition.optics
        return replace(
            draw_optics(optics, uncertain, drawn) if drawn is not None else optics, **values
        )

    drawn = declare.whole(None, "seed of a lens that differs from its calibration", 0)
    optics = {**_with_defaults(_OPTICS, condition.optics), "drawn": drawn}
    return {
        **_POSE,
        "mount": declare.choice(
            False, "earth: the camera turns with the Earth", {"sky": False, "earth": True}
        ),
        "poses": declare.table((), "later poses, in order of time", _LATER, array=True),
        "atmosphere": declare.table(
            None, "the atmosphere between camera and stars", _AIR, _atmosphere
        ),
        **SkyScene.declared(),
        **_with_defaults(SkyCondition.declared(), condition),
        "seed": declare.whole(0, "of noise, atmosphere, false stars and hot pixels", 0),
        "optics": declare.table(None, "values of the lens that differ", optics, lens),
        "hazards": hazard_tables(SKY_HAZARDS, seed),
    }


def _picture_keys(condition: SkyCondition) -> declare.Keys:
    temperature = {"temperature_c": SkyCondition.declared()["temperature_c"]}
    return {
        "file": declare.text(declare.REQUIRED, "PNG, JPEG, TIFF or FITS"),
        **PictureScene.declared(),
        **_with_defaults(temperature, condition),
        "hazards": hazard_tables({}),
    }


def sky_keys(condition: SkyCondition, uncertain: Mapping[str, float]) -> dict[str, Any]:
    """Declared keys of each kind as JSON; arguments as of `load_scene`."""
    sky = _sky_keys(condition, uncertain)
    return {"sky": declare.described(sky), "picture": declare.described(_picture_keys(condition))}


def _sky(
    given: Mapping[str, Any], condition: SkyCondition, uncertain: Mapping[str, float]
) -> SkyView:
    values = declare.read_table(given, _sky_keys(condition, uncertain, given.get("seed", 0)))
    first = _pose({key: values.pop(key) for key in _POSE if key in values})
    poses: list[Pose] = []
    for pose in values.pop("poses", ()):
        if not _ATTITUDE.keys() & pose.keys():
            # It continues from the attitude that the previous pose has reached.
            pose["quaternion"] = (poses or [first])[-1].at(pose.get("at_s", 0.0))
        poses.append(_pose(pose))
    if values.pop("mount", False):
        if poses or np.any(np.asarray(first.rate_deg_s)):
            raise SceneError('mount = "earth" needs one pose without rate_deg_s')
        first = replace(first, rate_deg_s=earth_rate_deg_s(first.quaternion))
    light, values["hazards"] = split_hazards(values.pop("hazards", ()))
    scene = SkyScene(
        first.quaternion,
        first.rate_deg_s,
        tuple(poses),
        **{**values_for(SkyScene, values), "hazards": light},
    )
    return SkyView(scene, replace(condition, **values_for(condition, values)))


def split_hazards(
    hazards: tuple[Hazard, ...],
) -> tuple[tuple[SkyHazard, ...], tuple[SensorHazard, ...]]:
    """Hazards of light, and those of sensor and lens."""
    return tuple(one for one in hazards if isinstance(one, SkyHazard)), tuple(
        one for one in hazards if isinstance(one, SensorHazard)
    )


def draw_optics(optics: Optics, uncertain: Mapping[str, float], seed: int) -> Optics:
    """A random lens whose calibration found ``optics``; SceneError if nothing is uncertain."""
    if not uncertain:
        raise SceneError("this lens has no uncertainties to draw from; omit drawn")
    generator = np.random.default_rng([seed, 0x1E25])
    off = {name: sigma * generator.standard_normal() for name, sigma in uncertain.items()}
    return replace(optics, **{name: getattr(optics, name) + by for name, by in off.items()})


def _pose(values: dict[str, Any]) -> Pose:
    angles = ANGLES.keys() & values.keys()
    if ("quaternion" in values) == bool(angles):
        raise SceneError("a pose needs either quaternion, or ra_deg and dec_deg")
    if angles:
        if not {"ra_deg", "dec_deg"} <= angles:
            raise SceneError("a pose with angles needs both ra_deg and dec_deg")
        ra, dec, roll = (values.pop(k, 0.0) for k in ANGLES)
        values["quaternion"] = quaternion_from_pointing(ra, dec, roll)
    return Pose(**values)


def _picture(given: Mapping[str, Any], folder: Path, condition: SkyCondition) -> SkyView:
    values = declare.read_table(given, _picture_keys(condition))
    _, values["hazards"] = split_hazards(values.pop("hazards", ()))
    condition = replace(condition, **values_for(condition, values))
    values["file"] = folder / values["file"]
    scene = PictureScene(**values_for(PictureScene, values))
    scene.part(condition.optics.columns, condition.optics.rows)
    return SkyView(scene, condition)
