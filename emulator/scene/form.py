"""Scenes for tools: the declared keys of scene files, a scene as the table of such a file, and the
places of cameras and bodies on a map of the sky.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.file import SceneError, read_scene_file
from cubestack.emulator.scene.hazards.contract import Body, SkyHazard
from cubestack.emulator.scene.hazards.hazard import Hazard
from cubestack.firmware_model.values import DeclaredValues, described, plain, read_table

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


@dataclass(frozen=True)
class DeclaredScene(DeclaredValues):
    """Base of frozen dataclasses whose fields are declared values, each a key of scene files.

    Attributes:
        kind: value of the key ``kind`` in their files.
    """

    kind: ClassVar[str]
    error = SceneError

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if not hasattr(cls, "kind"):
            raise SceneError(f"{cls.__name__} has no kind: what scene files have as `kind`")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a scene file; SceneError names the wrong key."""
        kinds = {cls.kind: lambda table: cls(**read_table(table, cls.declared()))}
        return read_scene_file(path, kinds, f'"{cls.kind}"')

    def sky_map(self, now_ps: int) -> SkyMap:
        """Its map of the sky at a time in ps; by default empty."""
        return SkyMap("no map", ())

    @classmethod
    def form(cls) -> SceneForm[Self]:
        return SceneForm(
            {cls.kind: described(cls.declared())}, lambda board: board.scene, _table, cls.sky_map
        )


def _table(scene: DeclaredScene) -> dict[str, Any]:
    return {"kind": scene.kind} | changed_fields(scene, type(scene)())
