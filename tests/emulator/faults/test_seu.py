import numpy as np
import pytest

from cubestack.emulator.faults.seu import flip_bit, flip_bits


def test_one_bit_is_turned_over_and_back() -> None:
    memory = np.zeros(4, np.uint8)
    flip_bit(memory, 13)
    assert memory.tolist() == [0, 0x20, 0, 0]
    flip_bit(memory, 13)
    assert not memory.any()


def test_the_rate_is_that_of_each_bit_and_the_seed_decides() -> None:
    first, again = np.zeros(200_000, np.uint8), np.zeros(200_000, np.uint8)
    count = flip_bits(first, 1e-3, np.random.default_rng(1))
    assert count == int(np.unpackbits(first).sum()) == pytest.approx(1600, rel=0.1)
    assert flip_bits(again, 1e-3, np.random.default_rng(1)) == count
    np.testing.assert_array_equal(first, again)
    memory = np.zeros(10, np.uint8)
    counts = [flip_bits(memory, rate, np.random.default_rng(1)) for rate in (0.0, 1.0)]
    assert counts == [0, 80]
    assert (memory == 0xFF).all()


@pytest.mark.parametrize("rate", [-0.1, 1.1, float("nan")])
def test_what_is_no_probability_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match="0 to 1 per bit"):
        flip_bits(np.zeros(1, np.uint8), rate, np.random.default_rng(1))
