"""Scenes for tools: the declared keys of scene files, a scene as the table of such a file, and the
places of cameras and bodies on a map of the sky.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.hazards.contract import Body, SkyHazard
from cubestack.emulator.scene.hazards.hazard import Hazard
from cubestack.firmware_model.values import plain

Matrix = NDArray[np.float64]
Table = dict[str, Any]
V = TypeVar("V")

DIGITS = 9
"""Digits of angles in degrees and of directions on the map; more would be rounding errors."""

WRITTEN_DIGITS = 6
"""Digits of unit vectors in scene files: 0.2 arcsec, and still readable."""


@dataclass(frozen=True, eq=False)
class CameraField:
    """A camera's field of view in the sky.

    Attributes:
        name: of the camera.
        axes: (3, 3), its x (right), y (down) and boresight as rows, in the scene's axes.
        outline: (n, 3), directions along the border of its picture, in order, in the scene's axes.
    """

    name: str
    axes: Matrix
    outline: Matrix


@dataclass(frozen=True, eq=False)
class SkyMap:
    """A scene on a map of the sky. Directions are in the scene's axes.

    Attributes:
        title: what these axes are.
        fields: of its cameras at time 0.
        now: of its cameras at the current time, if they have turned since time 0.
        bodies: their places at time 0.
        marks: points for orientation on the map.
        stars: whether the axes are those of the stars.
        turn: (3, 3), from the scene's axes to those of the map, whose z is up.
    """

    title: str
    fields: tuple[CameraField, ...]
    now: tuple[CameraField, ...] = ()
    bodies: tuple[Body, ...] = ()
    marks: Mapping[str, Matrix] = field(default_factory=dict)
    stars: bool = False
    turn: Matrix = field(default_factory=lambda: np.eye(3))

    def as_dict(self) -> dict[str, Any]:
        return {
            "title": self.title,
            "fields": [_field(one) for one in self.fields],
            "now": [_field(one) for one in self.now],
            "bodies": [
                {
                    "name": one.name,
                    "direction": round_values(one.direction),
                    "radius_deg": one.radius_deg,
                }
                for one in self.bodies
            ],
            "marks": {name: round_values(mark) for name, mark in self.marks.items()},
            "stars": self.stars,
            "turn": self.turn.tolist(),
        }


@dataclass(frozen=True)
class SceneForm(Generic[V]):
    """What tools need of the scenes of one kind of device."""

    #: of scene files, by kind, as ``values.described`` has them
    keys: Mapping[str, Mapping[str, Any]]
    view: Callable[[Any], V]  #: the scene and condition that the cameras of a board have
    table: Callable[[V], Table]  #: the scene file's table that gives such a view again
    sky_map: Callable[[V, int], SkyMap]  #: the map of such a view, with its state at a time in ps


def _field(one: CameraField) -> dict[str, Any]:
    return {"name": one.name, "axes": round_values(one.axes), "outline": round_values(one.outline)}


def round_values(values: Any, digits: int = DIGITS) -> Any:
    """Numbers of any shape, rounded to ``digits`` after the point, as lists; never -0."""
    return (np.round(np.asarray(values, np.float64), digits) + 0.0).tolist()


def changed_fields(thing: Any, usual: Any, *without: str) -> Table:
    """Fields of a dataclass that differ from ``usual`` and can be written in TOML, by name."""
    found = {}
    for one in fields(thing):
        if one.init and one.name not in without:
            value = plain(getattr(thing, one.name))
            if value is not None and value != plain(getattr(usual, one.name)):
                found[one.name] = value
    return found


def hazard_table(hazards: tuple[Hazard, ...], seed: int) -> Table:
    """The key ``hazards`` of a file with this ``seed``, if there are any hazards."""
    found: dict[str, list[Table]] = {}
    for one in hazards:
        own = changed_fields(one, type(one)(), "seed")
        found.setdefault(one.name, []).append(
            own | ({} if one.seed == seed else {"seed": one.seed})
        )
    return {"hazards": found} if found else {}


def bodies_of(hazards: tuple[SkyHazard, ...]) -> tuple[Body, ...]:
    """Bodies that hazards of light place in the sky, each once."""
    found: dict[tuple[str, tuple[float, ...]], Body] = {}
    for hazard in hazards:
        for body in hazard.bodies:
            found.setdefault((body.name, tuple(round_values(body.direction))), body)
    return tuple(found.values())
