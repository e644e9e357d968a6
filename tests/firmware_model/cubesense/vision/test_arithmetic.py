import numpy as np
import pytest

from cubestack.firmware_model.cubesense.vision.arithmetic import sequential_sum, to_int16


@pytest.mark.parametrize(
    ("value", "cast"),
    [(2.9, 2), (-2.9, -2), (32767.5, 32767), (32768.0, -32768), (-32769.0, 32767), (65536.0, 0)],
)
def test_a_cast_truncates_and_wraps(value: float, cast: int) -> None:
    assert to_int16(np.float32(value)) == cast


def test_a_sum_rounds_after_every_term() -> None:
    terms = np.array([2**24, 1, 1, 1, 1], np.float32)
    # Each 1 alone is lost beside 2^24; summed in pairs they would not be.
    assert sequential_sum(terms) == 2**24


def test_the_sum_of_nothing_is_nothing() -> None:
    assert sequential_sum(np.zeros((0, 3), np.float32)).tolist() == [0, 0, 0]
