"""What a camera looks at: the night sky from a moving spacecraft, or a picture.

A scene is data, made in Python or loaded from a TOML file::

    kind = "sky"
    ra_deg = 83.8                  # or quaternion = [x, y, z, w], inertial to camera, scalar last
    dec_deg = -5.4
    roll_deg = 30.0                # angle of the picture's up direction, east of north
    rate_deg_s = [0.0, 0.1, 0.0]   # body rate in camera axes: x right, y down, z out of the lens
    mag_limit = 3.8                # leave out to see all stars

    kind = "picture"
    file = "night.jpg"             # relative to the scene file
    crop = [0, 256]                # column and row of the first pixel used

A picture is light as it is: the camera gives its grey values unchanged, whatever exposure is set.
Only the undefined first frame of the camera differs, in proportion to its exposure. With
``exposure_ms``, the exposure that the picture was taken with, it scales with any exposure.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.optics import COLUMNS, ROWS, Distortion, Optics
from cubestack.emulator.scene.attitude import propagate, quaternion_from_pointing, unit_quaternion
from cubestack.emulator.scene.file import (
    Readers,
    flag,
    load_toml,
    number,
    read_table,
    several,
    text,
    whole,
)
from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH
from cubestack.emulator.scene.picture import SceneError, load_picture
from cubestack.emulator.sim.virtual_time import PS_PER_S

__all__ = ["FASTEST_DEG_S", "PictureScene", "Pose", "Scene", "SceneError", "SkyScene", "load_scene"]

FASTEST_DEG_S = 100.0
"""Body rate about one axis, at most (assumed): a star smears over the picture's whole height.

The time to render a frame grows with the rate; it is ten seconds there.
"""


@dataclass(frozen=True, eq=False)
class Pose:
    """An attitude and a constant body rate from some time on.

    Attributes:
        quaternion: (4,), scalar last, inertial to camera, at ``start_s``.
        rate_deg_s: (3,), body rate in camera axes, each at most ``FASTEST_DEG_S`` in size.
        start_s: virtual time from which on it holds.
    """

    quaternion: ArrayLike
    rate_deg_s: ArrayLike = (0.0, 0.0, 0.0)
    start_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no attitude or no rate."""
        _check_quaternion(self.quaternion)
        rate = np.asarray(self.rate_deg_s)
        if rate.shape != (3,) or not np.all(np.abs(rate) <= FASTEST_DEG_S):
            raise SceneError(
                f"rate_deg_s must be 3 numbers in deg/s, at most {FASTEST_DEG_S:g} each, "
                f"not {self.rate_deg_s}"
            )

    def at(self, time_s: float) -> NDArray[np.float64]:
        """Quaternion (4,) at ``time_s``."""
        return propagate(self.quaternion, self.rate_deg_s, time_s - self.start_s)


@dataclass(frozen=True, eq=False)
class SkyScene:
    """The night sky.

    Attributes:
        quaternion: attitude (4,) at time 0, scalar last, inertial (ICRS at ``epoch``) to camera.
        rate_deg_s: body rate (3,) in camera axes.
        poses: later poses, each holding from its start on; in the order of their starts.
        epoch: Julian year of the stars' positions.
        mag_limit: stars with V strictly below it are seen; None for all that the camera resolves.
        false_stars: number of lights at random places of the picture that no catalogue has.
        false_star_mag: range of their magnitudes, brightest first, uniform (assumed).
        noise: False makes the sensor ideal: no noise, no dark current, no defects.
        seed: of noise, false stars and hot pixels.
        temperature_c: of the sensor.
        hot_pixels: number of pixels that radiation has made hot since the sensor left the factory.
        optics: the lens.
    """

    quaternion: ArrayLike
    rate_deg_s: ArrayLike = (0.0, 0.0, 0.0)
    poses: tuple[Pose, ...] = ()
    epoch: float = DEFAULT_EPOCH
    mag_limit: float | None = None
    false_stars: int = 0
    false_star_mag: tuple[float, float] = (2.0, 3.8)
    noise: bool = True
    seed: int = 0
    temperature_c: float = 20.0
    hot_pixels: int = 20
    optics: Optics = field(default_factory=Optics)

    def __post_init__(self) -> None:
        """Refuse a sky that can not be."""
        starts = [pose.start_s for pose in self._all_poses]
        if sorted(starts) != starts:
            raise SceneError(f"poses must start one after the other from 0 s on, not at {starts}")
        for name in ("false_stars", "hot_pixels", "seed"):
            if getattr(self, name) < 0:
                raise SceneError(f"{name} must not be negative, not {getattr(self, name)}")
        pixels = self.optics.columns * self.optics.rows
        if self.hot_pixels > pixels:
            raise SceneError(f"hot_pixels must be at most {pixels}, not {self.hot_pixels}")
        brightest, faintest = self.false_star_mag
        if not brightest <= faintest:
            raise SceneError(
                f"false_star_mag must not fall, not from {brightest:g} to {faintest:g}"
            )
        _check_temperature(self.temperature_c)

    @classmethod
    def pointing(cls, ra_deg: float, dec_deg: float, roll_deg: float = 0.0) -> "SkyScene":
        """The sky along a boresight, the picture's up direction ``roll_deg`` east of north."""
        return cls(quaternion_from_pointing(ra_deg, dec_deg, roll_deg))

    @cached_property
    def _all_poses(self) -> tuple[Pose, ...]:
        return (Pose(self.quaternion, self.rate_deg_s), *self.poses)

    @cached_property
    def speed_deg_s(self) -> float:
        """Largest body rate of all poses, deg/s."""
        return max(float(np.linalg.norm(np.asarray(p.rate_deg_s))) for p in self._all_poses)

    def pose_at(self, time_ps: int) -> Pose:
        """The pose that holds at a time."""
        current = self._all_poses[0]
        for pose in self.poses:
            if pose.start_s * PS_PER_S <= time_ps:
                current = pose
        return current

    def truth(self, time_ps: int) -> NDArray[np.float64]:
        """The attitude (4,) at a time: scalar last, inertial to camera."""
        return self.pose_at(time_ps).at(time_ps / PS_PER_S)

    def turned(self, rotation_deg: ArrayLike) -> "SkyScene":
        """The same sky, all poses turned by a rotation vector (3,) in camera axes, in degrees."""
        return replace(
            self,
            quaternion=propagate(self.quaternion, rotation_deg, 1.0),
            poses=tuple(
                replace(pose, quaternion=propagate(pose.quaternion, rotation_deg, 1.0))
                for pose in self.poses
            ),
        )


@dataclass(frozen=True, eq=False)
class PictureScene:
    """A picture file as the light on the sensor: PNG, JPEG or TIFF, grey or colour.

    Attributes:
        file: the picture.
        crop: column and row of its first pixel that the sensor sees.
        exposure_ms: exposure that it was taken with; None: grey values do not scale.
        quaternion: its attitude (4,) if known.
        temperature_c: of the sensor.
        size: columns and rows of the sensor.
    """

    file: Path
    crop: tuple[int, int] = (0, 0)
    exposure_ms: float | None = None
    quaternion: ArrayLike | None = None
    temperature_c: float = 20.0
    size: tuple[int, int] = (COLUMNS, ROWS)
    pixels: NDArray[np.uint8] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Load the picture; SceneError when there is none that fits, or a value is wrong."""
        if self.quaternion is not None:
            _check_quaternion(self.quaternion)
        _check_temperature(self.temperature_c)
        if self.exposure_ms is not None and not self.exposure_ms > 0:
            raise SceneError(f"exposure_ms must be above 0, not {self.exposure_ms}")
        object.__setattr__(self, "pixels", load_picture(Path(self.file), self.crop, self.size))

    def truth(self, time_ps: int) -> NDArray[np.float64] | None:
        """The picture's attitude if known, whatever the time."""
        del time_ps
        return None if self.quaternion is None else unit_quaternion(self.quaternion)


Scene = SkyScene | PictureScene


def _check_quaternion(quaternion: ArrayLike) -> None:
    try:
        unit_quaternion(quaternion)
    except ValueError as error:
        raise SceneError(str(error)) from None


def _check_temperature(temperature_c: float) -> None:
    if not -60 <= temperature_c <= 125:
        raise SceneError(f"temperature_c must be in -60..125, not {temperature_c}")


def load_scene(path: Path, lens: Optics | None = None) -> Scene:
    """The scene that a TOML file describes; SceneError names the key that is wrong.

    ``lens`` stands for what the file leaves open of lens and sensor, CubeStar's unless given.
    """
    lens = Optics() if lens is None else lens
    table = load_toml(path)
    try:
        kind = table.pop("kind", None)
        if kind == "sky":
            return _sky(table, lens)
        if kind == "picture":
            return _picture(table, Path(path).parent, lens)
        raise SceneError(f'kind must be "sky" or "picture", not {kind!r}')
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def _optics(lens: Optics) -> Callable[[Any], Optics]:
    """Reader of the table "optics", which changes ``lens``."""

    def read(value: Any) -> Optics:
        if not isinstance(value, dict):
            raise SceneError(f"must be a table, not {value!r}")
        return replace(lens, **read_table(value, _OPTICS))

    return read


def _distortion(value: Any) -> Distortion:
    try:
        return Distortion(value)
    except ValueError:
        raise SceneError(f"must be one of {[d.value for d in Distortion]}, not {value!r}") from None


#: Keys of the table "optics"; the sensor's size is the device's.
_OPTICS: Readers = {
    f.name: _distortion if f.name == "distortion" else number
    for f in fields(Optics)
    if f.name not in ("columns", "rows")
}
_POSE: Readers = {
    "ra_deg": number,
    "dec_deg": number,
    "roll_deg": number,
    "quaternion": several(4, number),
    "rate_deg_s": several(3, number),
}
_SKY: Readers = _POSE | {
    "poses": lambda value: value,
    "epoch": number,
    "mag_limit": number,
    "false_stars": whole,
    "false_star_mag": several(2, number),
    "noise": flag,
    "seed": whole,
    "temperature_c": number,
    "hot_pixels": whole,
}
_PICTURE: Readers = {
    "file": text,
    "crop": several(2, whole),
    "exposure_ms": number,
    "quaternion": several(4, number),
    "temperature_c": number,
}


def _sky(table: Mapping[str, Any], lens: Optics) -> SkyScene:
    values = {"optics": lens} | read_table(table, _SKY | {"optics": _optics(lens)})
    later = values.pop("poses", [])
    if not isinstance(later, list) or not all(isinstance(pose, dict) for pose in later):
        raise SceneError("poses must be tables, each under [[poses]]")
    poses = [_pose(read_table(pose, _POSE | {"start_s": number})) for pose in later]
    first = _pose({key: values.pop(key) for key in _POSE if key in values})
    return SkyScene(first.quaternion, first.rate_deg_s, tuple(poses), **values)


def _pose(values: dict[str, Any]) -> Pose:
    angles = {"ra_deg", "dec_deg", "roll_deg"} & values.keys()
    if ("quaternion" in values) == bool(angles):
        raise SceneError("a pose needs either quaternion, or ra_deg and dec_deg")
    if angles:
        if not {"ra_deg", "dec_deg"} <= angles:
            raise SceneError("a pose with angles needs both ra_deg and dec_deg")
        ra, dec, roll = (values.pop(k, 0.0) for k in ("ra_deg", "dec_deg", "roll_deg"))
        values["quaternion"] = quaternion_from_pointing(ra, dec, roll)
    return Pose(**values)


def _picture(table: Mapping[str, Any], folder: Path, lens: Optics) -> PictureScene:
    values = read_table(table, _PICTURE)
    values["size"] = lens.columns, lens.rows
    if "file" not in values:
        raise SceneError("a picture needs the key file")
    return PictureScene(folder / values.pop("file"), **values)
