"""What each telecommand of the table does: a register for the modules that show it."""

from collections.abc import Callable

import pytest

from ..registry import registered_in
from .harness import Harness
from .sky import Sky

Effect = Callable[[Harness, Sky], None]
EFFECTS: dict[str, Effect] = {}

#: Decorator: the function shows what the named telecommand does.
telecommand = registered_in(EFFECTS)


def shown(unit: Harness, frame: str, **values: float) -> None:
    """Telemetry ``frame`` shows exactly these ``values``."""
    found = unit.telemetry(frame)
    assert found == pytest.approx(values, rel=1e-6), f"{frame} shows {found}"
