import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.aramis.catalogue import hamming
from cubestack.firmware_model.aramis.catalogue.hamming import decode, encode

from ..sky import meter

words = st.binary(min_size=8, max_size=8)


def flipped(coded: np.ndarray, *bits: int) -> np.ndarray:
    damaged = coded.copy()
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    return damaged


def test_columns_are_distinct_odd_and_none_is_a_check_bit_s() -> None:
    columns = hamming._columns()
    assert len(set(columns)) == 64
    assert all(column.bit_count() % 2 == 1 and column.bit_count() > 1 for column in columns)


@given(st.binary(max_size=100))
def test_undamaged_words_are_unchanged(data: bytes) -> None:
    coded = encode(data)
    assert len(coded) == hamming.coded_size(len(data))
    decoded = decode(coded, meter())
    assert decoded.data.tobytes() == data + bytes(-len(data) % 8)
    assert (decoded.corrected, len(decoded.lost)) == (0, 0)


@given(words)
def test_each_single_error_is_corrected(data: bytes) -> None:
    coded = encode(data)
    copies = np.concatenate([flipped(coded, bit) for bit in range(72)])
    before = copies.copy()
    decoded = decode(copies, meter())
    np.testing.assert_array_equal(copies, before)
    assert decoded.data.tobytes() == data * 72
    assert (decoded.corrected, len(decoded.lost)) == (72, 0)


@given(words)
def test_each_double_error_is_detected(data: bytes) -> None:
    coded = encode(data)
    pairs = [(one, two) for one in range(72) for two in range(one)]
    copies = np.concatenate([flipped(coded, *pair) for pair in pairs])
    decoded = decode(copies, meter())
    assert decoded.corrected == 0
    assert decoded.lost.tolist() == list(range(len(pairs)))


def test_the_code_is_linear() -> None:
    """The check byte of a sum is the sum of the check bytes: an oracle for the tables."""
    rng = np.random.default_rng(1)
    one, two = rng.bytes(8), rng.bytes(8)
    both = bytes(a ^ b for a, b in zip(one, two, strict=True))
    assert (encode(one) ^ encode(two)).tolist() == encode(both).tolist()
    single = encode((1 << 5).to_bytes(8, "little"))
    assert single[8] == hamming._columns()[5]


def test_the_cost_is_that_of_the_words_read() -> None:
    counter = meter()
    decode(encode(bytes(800)), counter)
    assert counter.counts["coded_word"] == 100
    assert counter.counts["flash_read"] == 100 * hamming.CODED_BYTES // 2


def test_rejects_partial_words() -> None:
    with pytest.raises(ValueError, match="words of 9 bytes, not 10"):
        decode(np.zeros(10, np.uint8), meter())
