import numpy as np
import pytest

from cubestack.firmware_model.cubestar.earlier_stars import MOST_STARS, EarlierStars


@pytest.mark.parametrize("count", range(MOST_STARS + 1))
def test_stars_survive_within_a_128th_of_a_pixel(count: int) -> None:
    places = np.random.default_rng(count).uniform(0, [1023, 511], (count, 2)).astype(np.float32)
    kept = EarlierStars.unpack(EarlierStars(12, 34, places).pack())
    assert (kept.image_us, kept.stars_us) == (12, 34)
    np.testing.assert_allclose(kept.centroids, places, atol=1 / 128)


def test_time_counts_modulo_32_bits_and_is_never_zero() -> None:
    earlier = EarlierStars(stars_us=(1 << 32) - 400)
    earlier.note_time((1 << 32) + 600)
    assert earlier.apart_us == 1000
    earlier.note_time(1 << 32)
    assert earlier.image_us == 1
    earlier.note_time(None)
    assert earlier.image_us == 0


def test_damaged_count_reads_no_further_than_there_are_stars() -> None:
    damaged = bytearray(EarlierStars().pack())
    damaged[8] = 255
    assert len(EarlierStars.unpack(bytes(damaged)).centroids) == MOST_STARS
