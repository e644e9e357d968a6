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
    [hazards.moon]                 # see docs/scene-keys.md
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
from cubestack.emulator.scene import file, keys
from cubestack.emulator.scene.atmosphere import Atmosphere, earth_rate_deg_s, sidereal_deg
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.hazards import SKY_HAZARDS, Hazard, SkyHazard
from cubestack.emulator.scene.sky import FASTEST_DEG_S, PictureScene, Pose, SkyScene


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


def _as_it_is(value: Any) -> Any:
    return value  # it is read when the whole table is


def _kinds(light: Mapping[str, type[SkyHazard]]) -> dict[str, type[Hazard]]:
    return {**light, **SENSOR_HAZARDS}


def hazard_tables(
    others: Mapping[str, type[SkyHazard]] = MappingProxyType({}),
    light: Mapping[str, type[SkyHazard]] = MappingProxyType(SKY_HAZARDS),
) -> file.Reader[Any]:
    """What the key ``hazards`` takes, for `read_hazards`; ``light`` are those of any scene."""
    about = file.made_of(_kinds({**light, **others})).about
    return file.Reader(_as_it_is, about).told("what makes the picture hard")


_distortion = file.one_of({d.value: d for d in Distortion}).told("which way the coefficients map")
_LENS = {
    "focal_length_mm": "scale of directions",
    "pixel_pitch_um": "of the sensor",
    "fx": "scale of the distortion's normalised coordinates across, px",
    "fy": "the same along a column, px",
    "cx": "principal point, column, px",
    "cy": "principal point, row, px",
    "k1": "radial coefficient, distorted to undistorted",
    "k2": "the next one",
    "p1": "tangential coefficient",
    "p2": "the other one",
    "psf_sigma_px": "standard deviation of a star's spot",
    "vignetting": "power of the cosine of the field angle by which the light falls off",
    "aperture_mm": "diameter of the entrance pupil",
    "effective_width_a": "bandwidth in Angstrom times transmission times quantum efficiency",
    "field_stop_deg": "diameter of the round field that a shade lets through; 360: none",
}
#: Keys of the table "optics"; the sensor's size is the device's.
_OPTICS: file.Readers = {
    f.name: _distortion if f.name == "distortion" else file.number.told(_LENS[f.name])
    for f in fields(Optics)
    if f.name not in ("columns", "rows", "residuals")
}
_ANGLES: file.Readers = {
    "ra_deg": file.angle.told("right ascension of the boresight", role="ra"),
    "dec_deg": file.declination.told("declination of the boresight", role="dec"),
    "roll_deg": file.angle.told(
        "angle of the picture's up direction, east of north", default=0.0, role="roll"
    ),
}
_RATE = file.number.told(low=-FASTEST_DEG_S, high=FASTEST_DEG_S)
_POSE: file.Readers = {
    **_ANGLES,
    "quaternion": file.several(4, file.number).told(
        "attitude, inertial to camera, scalar last; or the angles", instead=list(_ANGLES)
    ),
    "rate_deg_s": file.several(3, _RATE).told("body rate about the camera axes"),
}
_AIR: file.Readers = {
    "latitude_deg": file.number.told("of the observer, north positive"),
    "longitude_deg": file.number.told("of the observer, east positive; with utc"),
    "utc": file.moment.told("date and time at time 0; with longitude_deg"),
    "sidereal_deg": file.number.told(
        "right ascension of the zenith at time 0", instead=["utc", "longitude_deg"]
    ),
    "height_m": file.number.told("above the sea"),
    "seeing_arcsec": file.number.told("width at half maximum in a large telescope"),
    "scintillation": file.flag.told("stars twinkle"),
    "extinction_mag": file.number.told("loss of light by one air mass"),
    "sky_mag": file.number.told("brightness of the sky, V of a square arcsecond"),
}


_air = file.subtable(_AIR, Atmosphere)


def _atmosphere(value: Any) -> Atmosphere:
    values = _air(value)
    place = {key: values.pop(key) for key in ("utc", "longitude_deg") if key in values}
    if ("sidereal_deg" in values) == bool(place) or len(place) == 1:
        raise file.SceneError("needs either sidereal_deg, or utc and longitude_deg")
    if "latitude_deg" not in values:
        raise file.SceneError("needs the key latitude_deg")
    if place:
        values["sidereal_deg"] = sidereal_deg(**place)
    return Atmosphere(**values)


_ATTITUDE = {"quaternion", "ra_deg", "dec_deg", "roll_deg"}
_LATER: file.Readers = {
    **_POSE,
    "start_s": file.number.told("time from which on the pose holds", default=0.0),
}
_SENSOR: file.Readers = {
    "noise": file.flag.told("false: no shot, dark and read noise, no defects"),
    "temperature_c": file.number.told("of the sensor; 8 degrees double the dark current"),
    "hot_pixels": file.whole.told("pixels that radiation has made hot", low=0),
}
_SKY: file.Readers = {
    **_POSE,
    "mount": file.one_of({"sky": False, "earth": True}).told(
        "earth: the camera turns with the Earth", default="sky"
    ),
    "poses": file.Reader(_as_it_is, {"type": "tables", "readers": _LATER, "owners": ()}).told(
        "later poses, in order of time"
    ),
    "atmosphere": file.Reader(_atmosphere, _air.about).told("the air that stars are seen through"),
    "still": file.flag.told("stars stand still during each exposure"),
    "epoch": file.number.told("Julian year to which proper motion carries the stars"),
    "mag_limit": file.number.told("only stars with V below it are seen"),
    "false_stars": file.whole.told("lights at random places that no catalogue has"),
    "false_star_mag": file.several(2, file.number).told("range of their V, brightest first"),
    "noise": _SENSOR["noise"],
    "seed": file.whole.told("of noise, air, false stars and hot pixels", low=0),
    "temperature_c": _SENSOR["temperature_c"],
    "hot_pixels": _SENSOR["hot_pixels"],
    "hazards": hazard_tables(),
}
_PICTURE: file.Readers = {
    "file": file.text.told("PNG, JPEG or TIFF"),
    "crop": file.several(2, file.whole).told("column and row of the first pixel that is seen"),
    "exposure_ms": file.number.told("that it was taken with: its light scales; else as it is"),
    "quaternion": file.several(4, file.number).told("attitude of the picture"),
    "temperature_c": _SENSOR["temperature_c"],
    "hazards": hazard_tables({}, {}),
}


def sky_keys(condition: SkyCondition, uncertain: Mapping[str, float]) -> dict[str, Any]:
    """What the keys of each kind are (`keys.declared`); arguments as of `load_scene`."""
    sky = keys.declared(_sky_readers(condition, uncertain), SkyScene, condition)
    return {"sky": sky, "picture": keys.declared(_PICTURE, PictureScene, condition)}


def _sky_readers(condition: SkyCondition, uncertain: Mapping[str, float]) -> file.Readers:
    readers: file.Readers = {
        **_OPTICS,
        "drawn": file.whole.told("seed of a lens that differs from its calibration"),
    }
    table = file.subtable(readers, condition.optics)

    def lens(value: Any) -> Optics:
        values = table(value)
        seed, optics = values.pop("drawn", None), condition.optics
        return replace(
            drawn_optics(optics, uncertain, seed) if seed is not None else optics, **values
        )

    return {**_SKY, "optics": file.Reader(lens, table.about).told("how the lens differs")}


def _sky(
    table: Mapping[str, Any], condition: SkyCondition, uncertain: Mapping[str, float]
) -> SkyView:
    values = file.read_table(table, _sky_readers(condition, uncertain))
    later = values.pop("poses", [])
    if not isinstance(later, list) or not all(isinstance(pose, dict) for pose in later):
        raise file.SceneError("poses must be tables, each under [[poses]]")
    first = _pose({key: values.pop(key) for key in _POSE if key in values})
    poses: list[Pose] = []
    for table in later:
        pose = file.read_table(table, _LATER)
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
    reader = file.made_of(_kinds({**SKY_HAZARDS, **others}), seed=values.get("seed", 0))
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
