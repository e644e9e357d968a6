"""Orbit files: TOML::

start = 2026-11-24T12:00:00Z   # virtual time 0
tle = ["1 25544U ...", "2 25544 ..."]  # or the table [circular]
hazards = true                 # Earth, Sun and Moon disturb cameras that look at the sky
[circular]
altitude_km = 600.0
inclination_deg = 97.8
node_deg = 20.0                # right ascension of the ascending node
along_deg = 0.0                # from there, at the start
[attitude]
kind = "nadir"                 # "inertial" or "waypoints"
offset_deg = [0.0, 0.0, 0.0]
[mountings.NAME]              # of a device; body axes
boresight = [0.0, -1.0, 0.0]
right = [1.0, 0.0, 0.0]
"""

from datetime import datetime
from pathlib import Path
from typing import Any

from sgp4.api import Satrec

from cubestack.emulator.scene import file
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.earth_sun import Mounting
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.orbit import (
    Attitude,
    Inertial,
    NadirPointing,
    Orbit,
    Waypoints,
    circular,
)

_CIRCULAR: file.Readers = {
    "altitude_km": file.within(160, 40_000),
    "inclination_deg": file.within(0, 180),
    "node_deg": file.angle,
    "along_deg": file.angle,
}
_RATE = file.several(3, file.within(-100, 100))
_TURN = file.several(3, file.angle)
_QUATERNION = file.several(4, file.number)


def load_orbit(path: Path) -> Orbit:
    """What the file says; SceneError names it, and the key that is wrong."""
    return file.read_file(path, _orbit)


def _orbit(table: dict[str, Any]) -> Orbit:
    values = file.read_table(
        table,
        {
            "start": _start,
            "tle": _lines,
            "hazards": file.flag,
            "circular": file.subtable(_CIRCULAR),
            "attitude": _attitude,
            "mountings": _mountings,
        },
    )
    if "start" not in values:
        raise SceneError("needs the key start")
    lines, elements = values.pop("tle", None), values.pop("circular", None)
    if (lines is None) == (elements is None):
        raise SceneError("needs either tle, or the table circular")
    if lines is not None:
        return Orbit(lines, **values)
    if missing := _CIRCULAR.keys() - elements.keys() - {"along_deg"}:
        raise SceneError(f"circular: needs the keys {', '.join(sorted(missing))}")
    return Orbit(circular(values["start"], **{"along_deg": 0.0} | elements), **values)


def _start(value: Any) -> datetime:
    found = file.moment(value)
    if found.tzinfo is None:
        raise SceneError(f"must say its time zone, as {found.isoformat()}Z")
    if not 1958 <= found.year <= 2049:
        raise SceneError(f"must be in 1958..2049, not {found.year}")
    return found


def _lines(value: Any) -> Satrec:
    """Two-line elements whose check sums are right."""
    if not isinstance(value, list) or len(value) != 2 or not all(type(v) is str for v in value):
        raise SceneError(f"must be two lines of text, not {value!r}")
    for number, line in enumerate(value, 1):
        if len(line) != 69 or line[0] != str(number):
            raise SceneError(f"line {number} must have 69 characters, the first a {number}")
        total = sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10
        if line[68] != str(total):
            raise SceneError(f"line {number} must end in its check sum {total}, not {line[68]}")
    try:
        satellite = Satrec.twoline2rv(*value)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"are no elements: {error}") from None
    if satellite.error:
        raise SceneError("are no elements of an orbit")
    return satellite


def _attitude(value: Any) -> Attitude:
    if not isinstance(value, dict) or value.get("kind") not in _ATTITUDES:
        raise SceneError(f"kind must be one of {', '.join(_ATTITUDES)}")
    values = dict(value)
    made: Attitude = _ATTITUDES[values.pop("kind")](values)
    return made


def _inertial(values: dict[str, Any]) -> Attitude:
    pose = file.read_table(
        values,
        {
            "ra_deg": file.angle,
            "dec_deg": file.declination,
            "roll_deg": file.angle,
            "quaternion": _QUATERNION,
            "rate_deg_s": _RATE,
        },
    )
    angles = [pose.pop(key, None) for key in ("ra_deg", "dec_deg", "roll_deg")]
    if ("quaternion" in pose) == (angles[0] is not None) or (angles[0] is None) != (
        angles[1] is None
    ):
        raise SceneError("attitude needs either quaternion, or ra_deg and dec_deg")
    if angles[0] is not None:
        turned = quaternion_from_pointing(angles[0], angles[1], angles[2] or 0.0)
        pose["quaternion"] = tuple(turned.tolist())
    return Inertial(**pose)


def _waypoints(values: dict[str, Any]) -> Attitude:
    points = values.get("points")
    if values.keys() != {"points"} or not isinstance(points, list):
        raise SceneError("attitude needs points, each under [[attitude.points]]")
    read = file.subtable({"at_s": file.within(0, 1e9), "quaternion": _QUATERNION})
    rows = [read(point) for point in points]
    if any(row.keys() != {"at_s", "quaternion"} for row in rows):
        raise SceneError("each of points needs at_s and quaternion")
    return Waypoints(tuple((row["at_s"], row["quaternion"]) for row in rows))


_ATTITUDES: dict[str, Any] = {
    "nadir": lambda values: NadirPointing(**file.read_table(values, {"offset_deg": _TURN})),
    "inertial": _inertial,
    "waypoints": _waypoints,
}


def _mountings(value: Any) -> dict[str, Mounting]:
    if not isinstance(value, dict):
        raise SceneError(f"must be tables by device, not {value!r}")
    read = file.subtable(
        {"boresight": file.several(3, file.number), "right": file.several(3, file.number)}
    )
    found = {}
    for name, table in value.items():
        values = read(table)
        if "boresight" not in values:
            raise SceneError(f"{name}: needs the key boresight")
        found[name] = Mounting(**values)
    for mounting in found.values():
        mounting.matrix  # noqa: B018  refuses what makes no axes
    return found
