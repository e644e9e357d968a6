import pytest

from cubestack.emulator.camera.common.dark import dark_at, hot_pixels


@pytest.mark.parametrize(
    ("temperature_c", "factor"), [(20, 1), (28, 2), (36, 4), (12, 0.5), (24, 2**0.5)]
)
def test_eight_degrees_double_it(temperature_c: float, factor: float) -> None:
    assert dark_at(3.0, temperature_c, 20.0) == pytest.approx(3.0 * factor)


def test_hot_pixels_have_the_requested_count_and_fixed_places() -> None:
    places, strengths = hot_pixels(5, 4000, 5000, 2.5)
    assert len(set(places.tolist())) == len(places) == len(strengths) == 4000
    assert places.min() >= 0
    assert places.max() < 5000
    # Exponential: the standard deviation is the mean.
    assert strengths.mean() == pytest.approx(2.5, rel=0.05)
    assert strengths.std() == pytest.approx(2.5, rel=0.06)
    assert hot_pixels(5, 4000, 5000)[1].mean() == pytest.approx(1.0, rel=0.05)
    assert (hot_pixels(6, 4000, 5000)[0] != places).any()
    assert len(hot_pixels(5, 0, 5000)[0]) == 0
