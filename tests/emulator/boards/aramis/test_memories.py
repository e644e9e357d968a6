"""Contents of the memories: those of a board made alone, and each board's own."""

import numpy as np
import pytest

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.boards.aramis.memories import flash_with
from cubestack.firmware_model.aramis.catalogue.flash_store import flash_image
from cubestack.firmware_model.aramis.hardware import FLASH_BYTES, SDRAM_BYTES
from tests.emulator.boards.aramis.conftest import catalogue, scene
from tests.tiers import quick


@pytest.mark.parametrize("seed", quick([0, 5], 1))
def test_sdram_and_the_numbers_after_it_are_those_of_the_seed(seed: int) -> None:
    rng = np.random.default_rng([seed, *AramisBoard.random_stream])
    wanted = rng.integers(1 << 32, size=SDRAM_BYTES // 4, dtype="<u4").view(np.uint8)
    after = rng.random(9)
    for _ in range(2):
        board = AramisBoard(scene(), None, seed=seed)
        np.testing.assert_array_equal(board.sdram, wanted)
        np.testing.assert_array_equal(board.rng.random(9), after)


def test_flash_starts_with_the_coded_catalogue_and_is_erased_after_it() -> None:
    coded = flash_image(catalogue().pack())
    flash = flash_with(catalogue()).copy()
    np.testing.assert_array_equal(flash[: len(coded)], coded)
    assert len(flash) == FLASH_BYTES
    assert (flash[len(coded) :] == 0xFF).all()
    assert (flash_with(None).copy() == 0xFF).all()


def test_a_write_reaches_no_other_board() -> None:
    first, second = (AramisBoard(scene(), catalogue()) for _ in range(2))
    before = second.sdram.copy(), second.catalogue_flash.copy()
    assert first.irradiate("sdram", 1e-6) > 0
    first.sdram[:], first.catalogue_flash[::4096] = 0, 0
    third = AramisBoard(scene(), catalogue())
    for board in (second, third):
        np.testing.assert_array_equal(board.sdram, before[0])
        np.testing.assert_array_equal(board.catalogue_flash, before[1])
