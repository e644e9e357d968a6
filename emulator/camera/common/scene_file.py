"""Scene files for cameras that look at the sky: TOML, of one of two kinds::

    kind = "sky"
    ra_deg = 83.8                  # or quaternion = [x, y, z, w], inertial to camera, scalar last
    dec_deg = -5.4
    roll_deg = 30.0                # angle of the picture's up direction, east of north
    rate_deg_s = [0.0, 0.1, 0.0]   # body rate in camera axes: x right, y down, z out of the lens
    mag_limit = 3.8                # leave out to see all stars
    mount = "earth"                # the camera turns with the Earth
    [atmosphere]                   # what the stars are seen through
    latitude_deg = -33.9
    sidereal_deg = 200.0           # right ascension of the zenith at time 0
    [hazards.moon]                 # see docs/scenes.md
    direction = [90.0, -10.0]

    kind = "picture"
    file = "night.jpg"             # relative to the scene file
    crop = [0, 256]                # column and row of the first pixel used

Each key goes to the scene or to the camera's condition, whichever has it; ``seed`` to both.

A picture is light as it is: the camera gives its grey values unchanged, whatever exposure is set.
Only an undefined frame differs, in proportion to its exposure. With ``exposure_ms``, the exposure
that the picture was taken with, it scales with any exposure.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from cubestack.emulator.camera.common.hazards import HAZARDS as SENSOR_HAZARDS
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.optics import Distortion, Optics
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.scene import file
from cubestack.emulator.scene.atmosphere import Atmosphere, earth_rate_deg_s, sidereal_deg
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.hazards import SKY_HAZARDS, Hazard, SkyHazard
from cubestack.emulator.scene.sky import PictureScene, Pose, SkyScene


def load_scene(
    path: Path, condition: SkyCondition, uncertain: Mapping[str, float] = MappingProxyType({})
) -> SkyView:
    """What the TOML file ``path`` gives; SceneError names the key that is wrong.

    ``condition`` stands for what the file leaves open of lens and sensor, ``uncertain`` has the
    standard deviations of its optics by name.
    """
    kinds = {
        "sky": lambda table: _sky(table, condition, uncertain),
        "picture": lambda table: _picture(table, Path(path).parent, condition),
    }
    return file.read_scene_file(path, kinds, '"sky" or "picture"')


#: Keys of the table "optics"; the sensor's size is the device's.
_OPTICS: file.Readers = {
    f.name: file.one_of({d.value: d for d in Distortion}) if f.name == "distortion" else file.number
    for f in fields(Optics)
    if f.name not in ("columns", "rows", "residuals")
}
_POSE: file.Readers = {
    "ra_deg": file.angle,
    "dec_deg": file.declination,
    "roll_deg": file.angle,
    "quaternion": file.several(4, file.number),
    "rate_deg_s": file.several(3, file.number),
}
_AIR: file.Readers = {
    "latitude_deg": file.number,
    "longitude_deg": file.number,
    "utc": file.moment,
    "sidereal_deg": file.number,
    "height_m": file.number,
    "seeing_arcsec": file.number,
    "scintillation": file.flag,
    "extinction_mag": file.number,
    "sky_mag": file.number,
}


def _atmosphere(value: Any) -> Atmosphere:
    values = file.subtable(_AIR)(value)
    place = {key: values.pop(key) for key in ("utc", "longitude_deg") if key in values}
    if ("sidereal_deg" in values) == bool(place) or len(place) == 1:
        raise file.SceneError("needs either sidereal_deg, or utc and longitude_deg")
    if "latitude_deg" not in values:
        raise file.SceneError("needs the key latitude_deg")
    if place:
        values["sidereal_deg"] = sidereal_deg(**place)
    return Atmosphere(**values)


def _mount(value: Any) -> bool:
    if value not in ("sky", "earth"):
        raise file.SceneError(f'must be "sky" or "earth", not {value!r}')
    return bool(value == "earth")


_ATTITUDE = {"quaternion", "ra_deg", "dec_deg", "roll_deg"}
_SKY: file.Readers = _POSE | {
    "mount": _mount,
    "poses": lambda value: value,
    "atmosphere": _atmosphere,
    "still": file.flag,
    "epoch": file.number,
    "mag_limit": file.number,
    "false_stars": file.whole,
    "false_star_mag": file.several(2, file.number),
    "noise": file.flag,
    "seed": file.whole,
    "temperature_c": file.number,
    "hot_pixels": file.whole,
    "hazards": lambda value: value,
}
_PICTURE: file.Readers = {
    "file": file.text,
    "crop": file.several(2, file.whole),
    "exposure_ms": file.number,
    "quaternion": file.several(4, file.number),
    "temperature_c": file.number,
    "hazards": lambda value: value,
}


def _sky(
    table: Mapping[str, Any], condition: SkyCondition, uncertain: Mapping[str, float]
) -> SkyView:
    def lens(value: Any) -> Optics:
        values = file.subtable(_OPTICS | {"drawn": file.whole})(value)
        seed, optics = values.pop("drawn", None), condition.optics
        return replace(
            drawn_optics(optics, uncertain, seed) if seed is not None else optics, **values
        )

    values = file.read_table(table, _SKY | {"optics": lens})
    later = values.pop("poses", [])
    if not isinstance(later, list) or not all(isinstance(pose, dict) for pose in later):
        raise file.SceneError("poses must be tables, each under [[poses]]")
    first = _pose({key: values.pop(key) for key in _POSE if key in values})
    poses: list[Pose] = []
    for table in later:
        pose = file.read_table(table, _POSE | {"start_s": file.number})
        if not _ATTITUDE & pose.keys():
            # It goes on from where the one before has turned to.
            pose["quaternion"] = (poses or [first])[-1].at(pose.get("start_s", 0.0))
        poses.append(_pose(pose))
    if values.pop("mount", False):
        if poses or np.any(np.asarray(first.rate_deg_s)):
            raise file.SceneError('mount = "earth" needs one pose without rate_deg_s')
        first = replace(first, rate_deg_s=earth_rate_deg_s(first.quaternion))
    light, wrong = read_hazards(values)
    scene = SkyScene(
        first.quaternion,
        first.rate_deg_s,
        tuple(poses),
        hazards=light,
        **file.values_for(SkyScene, values),
    )
    values["hazards"] = wrong
    return SkyView(scene, replace(condition, **file.values_for(condition, values)))


def read_hazards(
    values: dict[str, Any], others: Mapping[str, type[SkyHazard]] = MappingProxyType({})
) -> tuple[tuple[SkyHazard, ...], tuple[SensorHazard, ...]]:
    """Hazards of light, and those of sensor and lens, of the tables under ``hazards``.

    Takes that key out of ``values``. The seed of a hazard is the file's, if it says no other.
    ``others`` are kinds that not every scene has.
    """
    kinds: dict[str, type[Hazard]] = {**SKY_HAZARDS, **others, **SENSOR_HAZARDS}
    reader = file.made_of(kinds, seed=values.get("seed", 0))
    hazards = file.read_table({"hazards": values.pop("hazards", {})}, {"hazards": reader})
    return tuple(h for h in hazards["hazards"] if isinstance(h, SkyHazard)), tuple(
        h for h in hazards["hazards"] if isinstance(h, SensorHazard)
    )


def drawn_optics(optics: Optics, uncertain: Mapping[str, float], seed: int) -> Optics:
    """A lens as it may be, where ``optics`` is what its calibration found."""
    if seed < 0 or not uncertain:
        wrong = f"not be negative, not {seed}" if uncertain else "be left out for this lens"
        raise file.SceneError(f"drawn must {wrong}")
    generator = np.random.default_rng([seed, 0x1E25])
    off = {name: sigma * generator.standard_normal() for name, sigma in uncertain.items()}
    return replace(optics, **{name: getattr(optics, name) + by for name, by in off.items()})


def _pose(values: dict[str, Any]) -> Pose:
    angles = {"ra_deg", "dec_deg", "roll_deg"} & values.keys()
    if ("quaternion" in values) == bool(angles):
        raise file.SceneError("a pose needs either quaternion, or ra_deg and dec_deg")
    if angles:
        if not {"ra_deg", "dec_deg"} <= angles:
            raise file.SceneError("a pose with angles needs both ra_deg and dec_deg")
        ra, dec, roll = (values.pop(k, 0.0) for k in ("ra_deg", "dec_deg", "roll_deg"))
        values["quaternion"] = quaternion_from_pointing(ra, dec, roll)
    return Pose(**values)


def _picture(table: Mapping[str, Any], folder: Path, condition: SkyCondition) -> SkyView:
    values = file.read_table(table, _PICTURE)
    if "file" not in values:
        raise file.SceneError("a picture needs the key file")
    light, values["hazards"] = read_hazards(values)
    if light:
        raise file.SceneError(f"a picture has no hazard of light, as {light[0].name} is")
    condition = replace(condition, **file.values_for(condition, values))
    values["file"] = folder / values["file"]
    scene = PictureScene(**file.values_for(PictureScene, values))
    scene.part(condition.optics.columns, condition.optics.rows)
    return SkyView(scene, condition)
