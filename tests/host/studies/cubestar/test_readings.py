import numpy as np
import pytest

from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.studies.cubestar.readings import (
    GOOD_SHARE,
    READINGS,
    Reading,
    error_px,
    readings_of_signs,
    share_of_pairs,
)


def test_printed_reading_is_what_the_firmware_starts_with() -> None:
    messages = {one.name: one for one in INTERFACE.telecommands}
    for name, values in READINGS["printed"].settings.items():
        declared = {one.name: one.default for one in messages[name].fields}
        assert values == pytest.approx({key: declared[key] for key in values}, rel=1e-6), name


def test_lens_that_is_the_inverse_leaves_no_error() -> None:
    inverse = READINGS["inverse"]
    assert error_px(inverse).max() < 0.001
    assert share_of_pairs(inverse) == 100


def test_rotation_counts_as_no_error_and_scale_does() -> None:
    """A pinhole whose focal length is 1 % off errs by 1 % of a star's distance from the middle."""
    straight = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}
    off = Reading(lens=straight, firmware=straight | {"focal_length_mm": 1.01 * 6.28})
    assert error_px(Reading(lens=straight, firmware=straight)).max() < 0.001
    middle = np.hypot(512, 256)  # of the image to its corner, where sines are shorter than tangents
    assert 0.006 * middle < error_px(off).max() < 0.01 * middle
    moved = Reading(lens=straight, firmware=straight | {"cx": LENS.cx + 10})
    assert error_px(moved).max() < 3


def test_best_signs_are_those_of_the_expanded_inverse() -> None:
    """1 + a r^2 + b r^4 has the inverse 1 - a r^2 + (3 a^2 - b) r^4, here with 3 a^2 > b > 0."""
    a, b = -LENS.k1, -LENS.k2
    assert 3 * a * a - b > 0
    best = max(readings_of_signs(), key=share_of_pairs).firmware
    chosen = (best["k1"], best["k2"], best["p1"], best["p2"])
    assert chosen == (-a, b, LENS.p1, LENS.p2)
    assert share_of_pairs(READINGS["first"]) == share_of_pairs(Reading(firmware=best))
    assert share_of_pairs(READINGS["printed"]) < GOOD_SHARE < share_of_pairs(READINGS["first"])


def test_all_combinations_are_tried_once() -> None:
    tried = readings_of_signs()
    assert len({tuple(sorted(one.firmware.items())) for one in tried}) == len(tried) == 128
