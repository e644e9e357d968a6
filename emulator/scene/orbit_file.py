"""Orbit files: TOML::

start = 2026-11-24T12:00:00Z   # virtual time 0
tle = ["1 25544U ...", "2 25544 ..."]  # or the table [circular]
hazards = true                 # Earth, Sun and Moon disturb cameras that look at the sky
[circular]
altitude_km = 600.0
inclination_deg = 97.8
node_deg = 20.0                # right ascension of the ascending node
along_deg = 0.0                # angle from the node at the start
[attitude]
kind = "nadir"                 # "inertial" or "waypoints"
offset_deg = [0.0, 0.0, 0.0]
[mountings.NAME]               # of a device's camera; body axes
boresight = [0.0, -1.0, 0.0]
right = [1.0, 0.0, 0.0]
"""

from datetime import datetime
from pathlib import Path
from typing import Any

from sgp4.api import Satrec

from cubestack.emulator.scene import orbit
from cubestack.emulator.scene.attitude import ANGLES, quaternion_from_pointing
from cubestack.emulator.scene.earth_sun import Mounting
from cubestack.emulator.scene.file import SceneError, read_file
from cubestack.firmware_model import values as declare


def load_orbit(path: Path) -> orbit.Orbit:
    """Read an orbit file; SceneError names the file and the wrong key."""
    return read_file(path, _orbit)


def _orbit(given: dict[str, Any]) -> orbit.Orbit:
    values = declare.read_table(given, _KEYS)
    lines, elements = values.pop("tle", None), values.pop("circular", None)
    if (lines is None) == (elements is None):
        raise SceneError("needs either tle, or the table circular")
    if lines is not None:
        return orbit.Orbit(lines, **values)
    return orbit.Orbit(orbit.circular(values["start"], **{"along_deg": 0.0} | elements), **values)


def _start(found: datetime) -> datetime:
    if found.tzinfo is None:
        raise SceneError(f"must have a time zone, as in {found.isoformat()}Z")
    if not 1958 <= found.year <= 2049:
        raise SceneError(f"must be in 1958..2049, not {found.year}")
    return found


def _lines(value: tuple[str, str]) -> Satrec:
    """Two-line elements; SceneError for a wrong form or check sum."""
    for count, line in enumerate(value, 1):
        if len(line) != 69 or line[0] != str(count):
            raise SceneError(f"line {count} must have 69 characters, the first a {count}")
        total = sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10
        if line[68] != str(total):
            raise SceneError(f"line {count} must end in its check sum {total}, not {line[68]}")
    try:
        satellite = Satrec.twoline2rv(*value)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"are not valid elements: {error}") from None
    if satellite.error:
        raise SceneError("are not the elements of an orbit")
    return satellite


_QUATERNION = declare.vector(4, declare.REQUIRED, "ICRS to body, scalar last")
_POINT = {
    "at_s": declare.number(declare.REQUIRED, "after the start", 0, 1e9),
    "quaternion": _QUATERNION,
}


def _inertial(pose: dict[str, Any]) -> orbit.Attitude:
    ra, dec, roll = (pose.pop(key, None) for key in ANGLES)
    if ("quaternion" in pose) == (ra is not None) or (ra is None) != (dec is None):
        raise SceneError("attitude needs either quaternion, or ra_deg and dec_deg")
    if ra is not None:
        pose["quaternion"] = tuple(quaternion_from_pointing(ra, dec, roll or 0.0).tolist())
    return orbit.Inertial(**pose)


_ATTITUDES: dict[str, declare.TableDeclaration] = {
    "nadir": declare.table(None, "body z to the Earth's centre", orbit.NadirPointing),
    "inertial": declare.table(
        None, "a fixed attitude or body rate", {**ANGLES, **orbit.Inertial.declared()}, _inertial
    ),
    "waypoints": declare.table(
        None,
        "quaternions at given times",
        {"points": declare.table(declare.REQUIRED, "in order of time", _POINT, array=True)},
        lambda values: orbit.Waypoints(
            tuple((p["at_s"], p["quaternion"]) for p in values["points"])
        ),
    ),
}


def _attitude(given: dict[str, Any]) -> orbit.Attitude:
    values = dict(given)
    kind = values.pop("kind", None)
    if kind not in _ATTITUDES:
        raise SceneError(f"kind must be one of {', '.join(_ATTITUDES)}")
    attitude: orbit.Attitude = _ATTITUDES[kind].read(values)
    return attitude


def _mountings(given: dict[str, Any]) -> dict[str, Mounting]:
    mounting = declare.table(None, "of the camera of a device", Mounting)
    return declare.read_table(given, dict.fromkeys(given, mounting))


_KEYS = {
    "start": declare.moment(declare.REQUIRED, "virtual time 0", make=_start),
    "tle": declare.ListDeclaration(
        part=declare.Declaration(kind=declare.TEXT),
        count=2,
        default=None,
        meaning="elements",
        make=_lines,
    ),
    "circular": declare.table(
        None,
        "a circular orbit instead of elements",
        {
            "altitude_km": declare.number(declare.REQUIRED, "above the Earth", 160, 40_000),
            "inclination_deg": declare.number(declare.REQUIRED, "of the orbit", 0, 180),
            "node_deg": declare.number(
                declare.REQUIRED, "right ascension of the ascending node", -360, 360
            ),
            "along_deg": declare.number(0.0, "angle from the node at the start", -360, 360),
        },
    ),
    "hazards": declare.flag(True, "Earth, Sun and Moon disturb cameras that look at the sky"),
    "attitude": declare.Declaration(kind=declare.TABLE, default=None, make=_attitude),
    "mountings": declare.Declaration(kind=declare.TABLE, default=None, make=_mountings),
}
