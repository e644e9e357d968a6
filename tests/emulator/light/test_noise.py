import numpy as np
import pytest
from scipy.special import kolmogorov, ndtr, ndtri

from cubestack.emulator.light.noise import FrameNoise, pieces
from tests.tiers import quick

COUNT = 1 << 20


def philox(counter: int, key: tuple[int, int]) -> list[int]:
    """Philox4x64-10 as the paper describes it."""
    low = (1 << 64) - 1
    words, keys = [counter, 0, 0, 0], list(key)
    for _ in range(10):
        first, second = 0xD2E7470EE14C6C93 * words[0], 0xCA5A826395121157 * words[2]
        words = [
            *(second >> 64 ^ words[1] ^ keys[0], second & low),
            *(first >> 64 ^ words[3] ^ keys[1], first & low),
        ]
        keys = [(keys[0] + 0x9E3779B97F4A7C15) & low, (keys[1] + 0xBB67AE8584CAA73B) & low]
    return words


def test_numbers_are_philox_of_the_paper() -> None:
    # The known answer that the authors publish.
    assert philox(0, (0, 0)) == [
        *(0x16554D9ECA36314C, 0xDB20FE9D672D0FDC, 0xD7E772CEE186176B, 0x7E68B68AEC7BA23B)
    ]
    frame = FrameNoise([1, 2])
    for block in (0, 1, 65_535):
        words = philox(block + 1, (int(frame.key[0]), int(frame.key[1])))
        halves = [half for word in words for half in (word & 0xFFFFFFFF, word >> 32)]
        assert frame.words(8 * block, 8).tolist() == halves


@pytest.mark.parametrize(("first", "count"), [(0, 1), (1, 8), (7, 2), (1000, 1024), (COUNT - 3, 3)])
def test_numbers_of_any_pixels_can_be_computed_alone(first: int, count: int) -> None:
    frame = FrameNoise([3, 4])
    whole = frame.normals(0, COUNT)
    np.testing.assert_array_equal(frame.normals(first, count), whole[first : first + count])


def test_other_seeds_give_independent_numbers() -> None:
    first, second = (FrameNoise([1, n]).normals(0, COUNT) for n in (0, 1))
    assert abs(np.corrcoef(first, second)[0, 1]) < 5 / np.sqrt(COUNT)
    np.testing.assert_array_equal(first, FrameNoise([1, 0]).normals(0, COUNT))


@pytest.mark.parametrize("seed", quick(range(3), 1))
def test_numbers_are_normal(seed: int) -> None:
    numbers = FrameNoise([seed, 7]).normals(0, COUNT).astype(float)
    steps = np.arange(COUNT + 1) / COUNT
    reached = ndtr(np.sort(numbers))
    farthest = max((steps[1:] - reached).max(), (reached - steps[:-1]).max())
    assert kolmogorov(np.sqrt(COUNT) * farthest) > 1e-4
    assert numbers.mean() == pytest.approx(0, abs=5 / np.sqrt(COUNT))
    assert numbers.var() == pytest.approx(1, abs=5 * np.sqrt(2 / COUNT))
    assert (numbers**4).mean() == pytest.approx(3, abs=5 * np.sqrt(96 / COUNT))
    for sigmas in (2.0, 3.0, 4.0):
        for tail in (numbers > sigmas, numbers < -sigmas):
            expected = COUNT * ndtr(-sigmas)
            assert tail.sum() == pytest.approx(expected, abs=5 * np.sqrt(expected))


@pytest.mark.parametrize("lag", [1, 2, 7, 8, 640, 1024, 1280])
def test_neighbours_are_uncorrelated(lag: int) -> None:
    numbers = FrameNoise([11]).normals(0, COUNT)
    for power in (1, 2):
        values = numbers.astype(float) ** power
        found = np.corrcoef(values[:-lag], values[lag:])[0, 1]
        assert abs(found) < 5 / np.sqrt(COUNT)


def test_pieces_follow_the_inverse_distribution_function() -> None:
    levels, slopes = pieces()
    tails = np.geomspace(0.5, 2.0**31 - 1, 20_001)
    segment = (tails.astype(np.float32).view(np.int32) >> 18) - (
        np.float32(0.5).view(np.int32) >> 18
    )
    found = levels[segment] + slopes[segment] * tails
    np.testing.assert_allclose(found, -ndtri(tails / 2**32), atol=1e-4)
