"""Base of all hazards: a name, declared values, and a scale of strength.

A hazard is a frozen dataclass of declared values, the keys of its table ``[hazards.NAME]`` in scene
files.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model import values as declare


@dataclass(frozen=True)
class Strength:
    """The scale on which experiments vary a hazard."""

    key: str  #: what varies: a field, or a quantity that ``sample`` converts
    unit: str  #: of its values, empty for a plain number
    values: tuple[float, ...]  #: from harmless to worst
    #: of a hazard without a given strength; None: the last of ``values``
    default: float | None = None

    @property
    def usual(self) -> float:
        return self.values[-1] if self.default is None else self.default


def heading(default: Any, meaning: str) -> Any:
    """A direction: three numbers, or right ascension and declination in degrees."""
    return declare.many(default, meaning, declare.number(declare.REQUIRED, ""), role="direction")


@dataclass(frozen=True, kw_only=True)
class Hazard(declare.DeclaredValues):
    """Something that makes pictures hard to use; SceneError for a value out of its range."""

    #: of its table in scene files and on the command line; by default from the class's name
    name: ClassVar[str]
    meaning: ClassVar[str]  #: what it is, one phrase
    strength: ClassVar[Strength]  #: the scale on which experiments vary it

    error = SceneError
    seed: int = declare.whole(0, "of everything random in it", 0, 2**63 - 1)

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "name" not in vars(cls):
            cls.name = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", cls.__name__).lower()

    @classmethod
    def refusal(cls, name: str, text: str) -> SceneError:
        return SceneError(f"{name} of the hazard {cls.name} {text}")

    @classmethod
    def sample(cls, strength: float, state: Any, generator: np.random.Generator) -> Self:
        """A hazard of this strength for one frame, drawn from ``generator``.

        ``state`` is the camera, for hazards that have a place in the sky.
        """
        del state
        counted = cls.declared()[cls.strength.key].kind is declare.WHOLE
        values: dict[str, Any] = {cls.strength.key: int(strength) if counted else strength}
        return cls(seed=int(generator.integers(2**31)), **values)


@dataclass(frozen=True, kw_only=True)
class HazardTables(declare.Declaration):
    """The key ``hazards``: tables as ``[hazards.moon]``, or ``[[hazards.debris]]`` for several."""

    meaning: str = "what makes the picture hard to use"
    default: Any = None
    kind: declare.ValueKind = declare.TABLE
    kinds: Mapping[str, type[Hazard]]  #: of hazards, by name
    seed: int = 0  #: of a hazard whose table has none

    def read(self, given: Any) -> tuple[Hazard, ...]:
        if not isinstance(given, dict):
            raise self.error(given)
        keys = {name: self._tables(kind, given.get(name)) for name, kind in self.kinds.items()}
        return tuple(one for some in declare.read_table(given, keys).values() for one in some)

    def _tables(self, kind: type[Hazard], given: Any) -> Any:
        several = isinstance(given, list)

        def make(values: dict[str, Any]) -> Any:
            made = kind(**{"seed": self.seed, **values})
            return made if several else (made,)

        return declare.table(None, "", kind, make, array=several)

    def described(self) -> dict[str, Any]:
        kinds = {
            name: {"meaning": kind.meaning, "keys": declare.described(kind.declared())}
            for name, kind in self.kinds.items()
        }
        return {**super().described(), "type": "kinds", "kinds": kinds}
