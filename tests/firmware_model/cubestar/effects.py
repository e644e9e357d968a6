"""What each telecommand of the table does: a register for the modules that show it."""

from collections.abc import Callable

import pytest

from .harness import Harness
from .sky import Sky

Effect = Callable[[Harness, Sky], None]
EFFECTS: dict[str, Effect] = {}


def telecommand(name: str) -> Callable[[Effect], Effect]:
    """The function shows what telecommand ``name`` does."""

    def register(effect: Effect) -> Effect:
        assert EFFECTS.setdefault(name, effect) is effect
        return effect

    return register


def shown(unit: Harness, frame: str, **values: float) -> None:
    """Telemetry ``frame`` shows exactly these ``values``."""
    found = unit.telemetry(frame)
    assert found == pytest.approx(values, rel=1e-6), f"{frame} shows {found}"
