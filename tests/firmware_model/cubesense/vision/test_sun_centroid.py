import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.distortion import Projection, RadiusTable, fine_table
from cubestack.firmware_model.cubesense.vision.masks import Mask
from cubestack.firmware_model.cubesense.vision.sun_centroid import SunConfig, find_sun, window_bytes
from cubestack.firmware_model.interface.cubesense.codes import DetectResult, Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20

from ..scenery import COLUMNS, ROWS, SUN_BORESIGHT, error_deg, place, sun, window


@pytest.fixture
def ours(equidistant: RadiusTable) -> SunConfig:
    return SunConfig(equidistant)


def p95(config: SunConfig, bloom_px: float, low_deg: float, high_deg: float) -> float:
    rng = np.random.default_rng(7)
    found = []
    for _ in range(40):
        tilt, turn = rng.uniform(low_deg, high_deg), rng.uniform(0, 2 * np.pi)
        truth = (tilt * np.cos(turn), tilt * np.sin(turn))
        picture = sun(place(*truth, SUN_BORESIGHT), bloom_px, rng)
        result = find_sun(window(picture), config, Meter(PIC18F45K20))
        assert result.detect is DetectResult.SUCCESS
        found.append(error_deg((result.alpha / 100, result.beta / 100), truth))
    return float(np.percentile(found, 95))


@pytest.mark.parametrize("bloom_px", [5, 6, 7])
def test_sun_error_meets_its_goal(ours: SunConfig, bloom_px: float) -> None:
    assert p95(ours, bloom_px, 0, 45) < 0.13  # the goal is 0.2
    assert p95(ours, bloom_px, 45, 90) < 0.13  # the goal is 2


@pytest.mark.parametrize("bloom_px", [4.0, 5.0, 6.0])
def test_sun_disc_with_sharp_edge_has_a_large_sigma(
    ours: SunConfig, meter: Meter, bloom_px: float
) -> None:
    """A flat Sun, or structure: the usual image fades over more than a pixel."""
    truth = (20.0, -13.0)
    picture = sun(place(*truth, SUN_BORESIGHT), bloom_px, flat=True)
    result = find_sun(window(picture), ours, meter)
    assert (result.detect, result.reason) == (DetectResult.SUCCESS, Reason.SHARP)
    assert error_deg((result.alpha / 100, result.beta / 100), truth) < 0.13
    assert result.sigma_alpha == result.sigma_beta == 4800


def test_sun_result_has_sigma_and_reason_unless_as_printed(ours: SunConfig, meter: Meter) -> None:
    data = window(sun(np.array([300.3, 200.6]), 6))
    result = find_sun(data, ours, meter)
    assert result.reason is Reason.MEASURED
    assert 2 <= result.sigma_alpha == result.sigma_beta <= 5
    printed = find_sun(data, SunConfig(ours.table, printed=True), meter)
    assert (printed.reason, printed.sigma_alpha) == (Reason.NONE, 0)


def test_sun_centroid_is_the_weighted_mean_from_the_boresight(
    equidistant: RadiusTable, meter: Meter
) -> None:
    picture = np.zeros((ROWS, COLUMNS), np.uint8)
    picture[250, 369:372] = 240
    picture[251, 371] = 225
    picture[252, 371] = 224  # below
    config = SunConfig(equidistant, printed=True)
    result = find_sun(window(picture), config, meter)
    assert result.pixels == 4
    total = 3 * 240 + 225
    mean = np.array([[(240 * (0 + 1 + 2) + 225 * 2) / total, 225 / total]], np.float32)
    assert [result.x, result.y] == equidistant.correct(mean, meter)[0].tolist()
    assert result.alpha == int(np.float32(result.x) / np.float32(2.9))


def test_uncut_sun_has_the_same_centroid_with_and_without_printed_mode(
    equidistant: RadiusTable, meter: Meter
) -> None:
    data = window(sun(np.array([200.3, 300.6]), 5))
    both = [
        find_sun(data, SunConfig(equidistant, printed=printed), meter) for printed in (False, True)
    ]
    assert [(b.x, b.y, b.pixels) for b in both] == 2 * [(both[0].x, both[0].y, both[0].pixels)]


def bright(*places: tuple[slice, slice]) -> NDArray[np.uint8]:
    picture = np.zeros((ROWS, COLUMNS), np.uint8)
    for at in places:
        picture[at] = 255
    return picture


@pytest.mark.parametrize(
    ("picture", "pixels"),
    [
        # The FPGA then hands out the last corner of the picture; what is there is no Sun either.
        (bright(np.s_[100:101, 100:102], np.s_[470:480:2, 630:632]), 0),
        (bright(np.s_[100:101, 100:103]), 3),
        (np.minimum(sun(np.array([300.0, 200.0]), 6), 220), 0),  # the FPGA finds it
    ],
    ids=["pair of stuck pixels", "row of stuck pixels", "reflection below the threshold"],
)
def test_sun_search_rejects_lights_that_are_not_the_sun(
    ours: SunConfig, meter: Meter, picture: NDArray[np.uint8], pixels: int
) -> None:
    result = find_sun(window(picture), ours, meter)
    assert (result.detect, result.pixels) == (DetectResult.SUN_NOT_FOUND, pixels)


def squares(*sides: int, level: int = 255) -> NDArray[np.uint8]:
    """A window of the picture's middle, with a bright rectangle in the middle of it."""
    width, height = sides
    data = np.zeros(window_bytes(), np.uint8)
    data[:4] = (104, 1, 100, 0)  # (360, 100)
    pixels = data[4:].reshape(15, 15)
    top, left = (15 - height) // 2, (15 - width) // 2
    pixels[top : top + height, left : left + width] = level
    return data


def hollow() -> NDArray[np.uint8]:
    data = squares(9, 9)
    data[4:].reshape(15, 15)[6:9, 6:9] = 0
    return data


def steps(apart: int) -> NDArray[np.uint8]:
    """Two squares in a corner, the lower one ``apart`` columns to the right: nothing is round."""
    data = squares(0, 0)
    pixels = data[4:].reshape(15, 15)
    pixels[:5, :5] = pixels[5:10, apart : apart + 5] = 255
    return data


def two_lights(*apart: int) -> NDArray[np.uint8]:
    one = np.array([300.0, 200.0])
    return window(np.maximum(sun(one, 5), sun(one + apart, 5)))


def nowhere() -> NDArray[np.uint8]:
    data = squares(9, 9)
    data[:4] = (0xFF, 3, 0xFF, 1)  # SUN_NOT_FOUND
    return data


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (nowhere(), Reason.NO_LIGHT),
        (squares(3, 2), Reason.NO_LIGHT),  # 6 of at least 7 pixels, in no other way wrong
        (squares(7, 1), Reason.NOT_ROUND),
        (squares(15, 13), Reason.TOO_LARGE),  # 195 of at most 190
        (squares(9, 9, level=254), Reason.NOT_SATURATED),
        (squares(5, 10), Reason.NOT_ROUND),  # sides that differ by 5
        (squares(5, 9), Reason.SHARP),  # by 4
        (hollow(), Reason.NOT_ROUND),
        (steps(5), Reason.NOT_ROUND),  # no column in common
        (steps(4), Reason.SHARP),
        (window(np.full((ROWS, COLUMNS), 255, np.uint8)), Reason.TOO_LARGE),
        # Two lights: neither of them is whole, and the mean is between them.
        *((two_lights(*apart), Reason.NOT_ROUND) for apart in ((8, 7), (-8, 7), (0, 9), (9, 3))),
    ],
)
def test_each_rejection_reason_has_an_example(
    ours: SunConfig, meter: Meter, data: NDArray[np.uint8], reason: Reason
) -> None:
    result = find_sun(data, ours, meter)
    assert result.reason is reason
    assert (result.detect is DetectResult.SUCCESS) == (reason is Reason.SHARP)


def test_sun_needs_half_of_its_pixels_saturated(ours: SunConfig, meter: Meter) -> None:
    for saturated, reason in ((40, Reason.SHARP), (39, Reason.NOT_SATURATED)):
        data = squares(8, 10, level=230)
        pixels = data[4:]
        pixels[np.flatnonzero(pixels)[:saturated]] = 255
        assert find_sun(data, ours, meter).reason is reason


def test_masked_pixels_do_not_count(ours: SunConfig, meter: Meter) -> None:
    data = window(sun(np.array([300.0, 200.0]), 6))
    masked = SunConfig(ours.table, masks=(Mask(280, 320, 180, 220),))
    assert find_sun(data, ours, meter).detect is DetectResult.SUCCESS
    assert find_sun(data, masked, meter).detect is DetectResult.SUN_NOT_FOUND


@pytest.mark.parametrize(("distance", "found"), [(224.0, True), (229.0, False)])
@pytest.mark.parametrize("turn", np.arange(0, 2 * np.pi, 0.7))
def test_light_beyond_the_field_rim_is_not_the_sun(
    ours: SunConfig, meter: Meter, distance: float, found: bool, turn: float
) -> None:
    centre = np.array(SUN_BORESIGHT) + distance * np.array([np.cos(turn), np.sin(turn)])
    detect = find_sun(window(sun(centre, 7)), ours, meter).detect
    assert detect is (DetectResult.SUCCESS if found else DetectResult.SUN_NOT_FOUND)


@pytest.mark.parametrize(("slope", "found"), [(0.8, True), (0.72, False)])
def test_no_lens_gives_an_angle_out_of_range(meter: Meter, slope: float, found: bool) -> None:
    """The Sun 215 px to the left, which such a lens images at 93 or at 103 deg."""
    config = SunConfig(fine_table(meter, Projection.EQUIDISTANT, (0, slope, 0, 0, 0)))
    centre = np.array(SUN_BORESIGHT) - (215, 0)
    result = find_sun(window(sun(centre, 7)), config, meter)
    assert result.detect is (DetectResult.SUCCESS if found else DetectResult.SUN_NOT_FOUND)
    assert result.alpha == (pytest.approx(-100 * 215 / slope / 2.9, abs=20) if found else 0)


def test_sun_angle_is_within_the_field_for_any_light(ours: SunConfig, meter: Meter) -> None:
    for x in range(10, COLUMNS, 90):
        for y in range(10, ROWS, 65):
            result = find_sun(window(sun(np.array([x, y], float), 5)), ours, meter)
            assert np.hypot(result.alpha, result.beta) < 9700


def test_sun_search_rejects_windows_of_other_lengths(ours: SunConfig, meter: Meter) -> None:
    assert window_bytes() == 229
    with pytest.raises(ValueError, match="229 bytes, not"):
        find_sun(np.zeros(228, np.uint8), ours, meter)
