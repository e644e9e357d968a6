"""The comparison of a board with the compiled engine finds planted faults and nothing else."""

from collections.abc import Callable

import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.devboard.check import BoardCheck, Found
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop

from ..pair_board import SIZES
from .boards import DirectChannel, engine_on, model

BOARD = cubestar_wiring(CubeStarTop(16, 6))


def check(
    wiring: Wiring, change: Callable[[str, int], int] | None = None, columns: int = 16
) -> list[Found | None]:
    """All results for one board, which may change what its pins show."""
    board = model(wiring)
    if change is not None:
        get = board.design.get
        board.design.get = lambda name: change(name, get(name))  # type: ignore[method-assign]
    checked = BoardCheck(
        wiring,
        lambda: engine_on(DirectChannel(board), wiring),
        lambda: make_engine(wiring, "compiled"),
        steps=60,
        columns=columns,
    )
    return list(checked.run())


PAIR = cubesense_wiring(CubeSensePair(SIZES[0]))


@pytest.mark.parametrize("wiring", [BOARD, pytest.param(PAIR, marks=pytest.mark.slow)])
def test_good_board_has_no_difference(wiring: Wiring) -> None:
    found = check(wiring)
    assert len(found) > 60
    assert not any(found)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            lambda name, level: level ^ 2 if name == "SRAM_A" and level == 37 else level,
            "SRAM_A is 27",
        ),
        (lambda name, level: level & 0x7F if name == "SRAM_D_O" else level, "SRAM_D_O is"),
        (lambda name, level: 0 if name == "ACK" else level, "ACK is 0 on the board, not 1"),
        (lambda name, level: level | 1 if name == "DATA" and level > 99 else level, "DATA is"),
    ],
)
def test_planted_fault_is_found_with_its_waves(
    change: Callable[[str, int], int], text: str
) -> None:
    *good, found = check(BOARD, change)
    assert not any(good)
    assert found is not None
    assert found.repeated
    assert any(line.startswith(text) for line in found.texts), found.texts
    *before, last = found.waves
    pin = text.split()[0]
    assert last.board[pin] != last.compiled[pin]
    assert before
    assert all(wave.board[pin] == wave.compiled[pin] for wave in before[-1:])
    times = [wave.time_ps for wave in found.waves]
    assert times == sorted(times)
