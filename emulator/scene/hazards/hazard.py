"""What all hazards have in common: a name, checked keys, and a scale of strength.

A hazard is a frozen dataclass. Its fields are the keys of its table ``[hazards.NAME]`` in scene
files, each declared by :func:`key` with its meaning and range, which documents and checks read.
"""

import math
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from cubestack.emulator.scene.file import SceneError


@dataclass(frozen=True)
class Strength:
    """The scale on which a hazard is swept.

    Attributes:
        key: what is swept: a field, or what ``placed`` makes of it.
        unit: of its values, empty for a plain number.
        values: from harmless to worst.
        default: that of a hazard asked for without a strength; None: the last of ``values``.
    """

    key: str
    unit: str
    values: tuple[float, ...]
    default: float | None = None

    @property
    def usual(self) -> float:
        """The strength where none is said."""
        return self.values[-1] if self.default is None else self.default


def key(
    default: Any, meaning: str, low: float = -math.inf, high: float = math.inf, role: str = ""
) -> Any:
    """A field of a hazard: what it is, with its unit, and its least and greatest value.

    ``role`` is "direction" for that of something, as ``emulator.scene.file.Reader`` tells it.
    """
    told = {"meaning": meaning, "range": (low, high)} | ({"role": role} if role else {})
    return field(default=default, metadata=told)


@dataclass(frozen=True, kw_only=True)
class Hazard:
    """One thing that makes pictures hard; SceneError for a value that is out of its range.

    Attributes:
        name: of its table in scene files and on the command line.
        meaning: what it is, one phrase.
        strength: on which scale it is swept.
    """

    name: ClassVar[str]
    meaning: ClassVar[str]
    strength: ClassVar[Strength]

    seed: int = key(0, "of all that is drawn for it", 0, 2**63 - 1)

    def __post_init__(self) -> None:
        """Refuse what is out of range."""
        for entry in fields(self):
            value = getattr(self, entry.name)
            low, high = entry.metadata.get("range", (-math.inf, math.inf))
            if isinstance(value, int | float) and not (
                low <= value <= high and math.isfinite(value)
            ):
                raise SceneError(
                    f"{entry.name} of the hazard {self.name} must be in {low:g}..{high:g}, "
                    f"not {value:g}"
                )

    @classmethod
    def placed(cls, strength: float, looking: Any, generator: np.random.Generator) -> Self:
        """One of this strength for one frame, drawn from ``generator``.

        ``looking`` says where the camera looks, for hazards that are somewhere.
        """
        del looking
        whole = cls.__dataclass_fields__[cls.strength.key].type in (int, int | None)
        values: dict[str, Any] = {cls.strength.key: int(strength) if whole else strength}
        return cls(seed=int(generator.integers(2**31)), **values)
