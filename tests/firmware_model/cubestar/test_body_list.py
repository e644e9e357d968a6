import numpy as np
import pytest

from cubestack.firmware_model.cubestar.body_list import PAGE_BYTES, Body, pack_bodies, read_bodies
from cubestack.firmware_model.interface.cubestar.extensions import MOST_BODIES
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter


def commanded(minutes: int, uptime_us: int = 90_500_000) -> Body:
    values = {"RightAscension": 1.0, "Declination": -0.5, "Radius": 0.0, "Accuracy": 1e-4}
    return Body.of_command(values | {"Minutes": minutes}, uptime_us, Meter(CORTEX_M3))


def test_command_gives_the_direction_and_the_end_of_its_validity() -> None:
    body = commanded(5)
    expected = [np.cos(0.5) * np.cos(1.0), np.cos(0.5) * np.sin(1.0), -np.sin(0.5)]
    np.testing.assert_allclose(body.direction, expected, atol=1e-7)
    assert body.until_s == 90 + 5 * 60
    assert commanded(0).until_s == 0


def test_page_keeps_every_body() -> None:
    bodies = [commanded(number) for number in range(MOST_BODIES)]
    kept = read_bodies(pack_bodies(bodies))
    assert len(pack_bodies(bodies)) == PAGE_BYTES
    for one, other in zip(kept, bodies, strict=True):
        np.testing.assert_array_equal(one.direction, other.direction)
        assert one.accuracy_rad == pytest.approx(other.accuracy_rad)
        assert (one.radius_rad, one.until_s) == (other.radius_rad, other.until_s)


def test_erased_page_lists_nothing() -> None:
    assert [body.until_s for body in read_bodies(None)] == [0] * MOST_BODIES
