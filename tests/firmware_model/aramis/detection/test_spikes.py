"""Both ways to remove spikes, against counting window by window."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.detection.charges import charge_spikes
from cubestack.firmware_model.aramis.detection.mask import HALF, SpikeRemoval, remove_spikes

from ..sky import meter

Mask = NDArray[np.bool_]
SHAPES = [(20, 25), (21, 28), (24, 22), (5, 5), (3, 4), (1, 1)]


def run(mask: Mask, method: SpikeRemoval, needed: int = HALF) -> Mask:
    return remove_spikes(mask, method, needed)[0]


def slowly(mask: Mask, method: SpikeRemoval, needed: int) -> Mask:
    """As section 3.5 says it, one window after the other."""
    rows, columns = mask.shape
    result = np.zeros_like(mask)
    if method is SpikeRemoval.CENTRE:
        for y in range(rows):
            for x in range(columns):
                window = mask[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3]
                result[y, x] = 25 * window.sum() >= needed * window.size
        return result
    for y in range(0, rows, 5):
        for x in range(0, columns, 5):
            window = mask[y : y + 5, x : x + 5]
            if 25 * window.sum() >= needed * window.size:
                result[y : y + 5, x : x + 5] = window
    return result


@pytest.mark.parametrize("method", [SpikeRemoval.CENTRE, SpikeRemoval.WINDOW])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("needed", [1, 8, HALF, 25])
def test_each_window_by_itself(method: SpikeRemoval, shape: tuple[int, int], needed: int) -> None:
    for seed in range(5):
        mask = np.random.default_rng(seed).random(shape) < 0.5
        np.testing.assert_array_equal(run(mask, method, needed), slowly(mask, method, needed))


@pytest.mark.parametrize("method", [SpikeRemoval.CENTRE, SpikeRemoval.WINDOW])
def test_spikes_go_and_stars_stay(method: SpikeRemoval) -> None:
    spikes = np.random.default_rng(1).random((100, 100)) < 0.05
    assert not run(spikes, method).any()
    star = np.zeros((100, 100), dtype=bool)
    star[40:50, 40:50] = True
    assert run(spikes | star, method)[40:50, 40:50].sum() > 90


def test_a_window_of_thirteen_stays_and_one_of_twelve_goes() -> None:
    mask = np.zeros((15, 15), dtype=bool)
    mask[5:10, 5:10].flat[:13] = True
    assert run(mask, SpikeRemoval.WINDOW).sum() == 13
    mask[5, 5] = False
    assert run(mask, SpikeRemoval.WINDOW).sum() == 0


def test_filter_off_leaves_the_image_unchanged() -> None:
    mask = np.random.default_rng(2).random((9, 9)) < 0.5
    assert run(mask, SpikeRemoval.OFF) is mask


def test_the_second_method_is_the_quicker_one() -> None:
    first, second = meter(), meter()
    charge_spikes((100, 100), SpikeRemoval.CENTRE, 0, first)
    charge_spikes((100, 100), SpikeRemoval.WINDOW, 0, second)
    looks = [spent.counts["table_byte"] for spent in (first, second)]
    assert looks == [4 * 100**2, 100**2]
    assert first.total > 4 * second.total
