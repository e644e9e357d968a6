"""Scenes that are declared by the keys of their files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from cubestack.emulator.scene.file import SceneError, read_scene_file
from cubestack.emulator.scene.form import SceneForm, SkyMap, changed_fields
from cubestack.firmware_model.values import DeclaredValues, described, read_table


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
