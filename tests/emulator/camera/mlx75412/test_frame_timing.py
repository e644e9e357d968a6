import pytest

from cubestack.emulator.camera.mlx75412.sensor import exposure_lines, frame_lines
from cubestack.firmware_model.interface.cameras.mlx75412 import LINE_CLOCKS, LONGEST_EXPOSURE


# CubeStar thesis, table D.2: register, expected and measured rate, approximate exposure in ms.
@pytest.mark.parametrize(
    ("register", "expected", "measured", "exposure_ms"),
    [
        (30, 11.111, 11.110, 90),
        (9, 3.333, 3.333, 300),
        (8, 2.963, 2.966, 337),
        (7, 2.593, 2.593, 386),
        (6, 2.222, 2.224, 450),
    ],
)
def test_published_rates_and_exposures(
    register: int, expected: float, measured: float, exposure_ms: int
) -> None:
    lines = frame_lines(27_000_000, register)
    rate = 10_000_000 / (lines * LINE_CLOCKS)
    assert rate == pytest.approx(expected, rel=5e-4)
    assert rate == pytest.approx(measured, rel=2e-3)
    longest = exposure_lines(LONGEST_EXPOSURE, 1, lines)
    assert longest == lines - 1
    assert longest * LINE_CLOCKS / 10_000 == pytest.approx(exposure_ms, abs=0.6)


def test_lowest_rate_is_published() -> None:
    # Equation C.0.1: the input clock divided by 5 413 590.
    for slow in (0, 1, 4):
        assert frame_lines(27_000_000, slow) * LINE_CLOCKS == 5_413_590


def test_frame_is_never_shorter_than_its_read_out() -> None:
    assert frame_lines(27_000_000, 60) == 520
    assert frame_lines(0, 7) == 520


def test_clock_register_only_scales() -> None:
    assert frame_lines(10_000_000, 3) == round(10_000_000 / 3 / LINE_CLOCKS)


def test_exposure_in_lines_within_the_frame() -> None:
    assert exposure_lines(0, 100, 700) == 100
    assert exposure_lines(0, 0, 700) == 1
    assert exposure_lines(0, 700, 700) == exposure_lines(0, 65535, 700) == 699
