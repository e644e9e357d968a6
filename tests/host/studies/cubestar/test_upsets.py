from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.studies.cubestar.upsets import _state


@pytest.mark.parametrize(
    ("boards", "high", "state"),
    [
        (1, "", "idle"),
        (1, "ENABLE", "storing"),
        (1, "ENABLE RNW", "reading"),
        (2, "BOARD1_RNW", "idle"),
        (2, "BOARD1_ENABLE", "storing"),
        (2, "BOARD1_ENABLE BOARD1_RNW BOARD2_ENABLE", "storing"),
        (2, "BOARD1_RNW BOARD2_ENABLE BOARD2_RNW", "reading"),
    ],
)
def test_state_is_storing_while_any_enabled_board_stores(
    boards: int, high: str, state: str
) -> None:
    engine: Any = SimpleNamespace(
        wiring=SimpleNamespace(acknowledges=("ACK",) * boards),
        get_pin=lambda pin: pin in high.split(),
    )
    assert _state(engine) == state
