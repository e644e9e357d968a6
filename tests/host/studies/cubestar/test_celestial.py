import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import matrix_from_quaternion, pointing_from_matrix
from cubestack.host.studies.cubestar.celestial import ZENITH_DISTANCE_DEG, followed
from cubestack.host.studies.cubestar.night import LATITUDE_DEG
from cubestack.host.studies.fidelity.table import Job, perform

SIDEREAL_DEG_H = 15.041  # of a star


def test_telescope_keeps_the_field_and_turns_it_by_the_parallactic_angle() -> None:
    """On the meridian the field turns by the Earth's rate times cos(latitude) / cos(altitude)."""
    scene = followed(135.0)
    assert scene.atmosphere is not None
    at_start, later = (matrix_from_quaternion(scene.truth(t)) for t in (0, 600 * 10**12))
    ra, dec, roll = pointing_from_matrix(at_start)
    assert (ra % 360, dec) == pytest.approx((135.0, LATITUDE_DEG + ZENITH_DISTANCE_DEG))
    ra_later, dec_later, roll_later = pointing_from_matrix(later)
    assert (ra_later % 360, dec_later) == pytest.approx((ra % 360, dec))
    expected = SIDEREAL_DEG_H * np.cos(np.radians(LATITUDE_DEG)) / np.sin(np.radians(45))
    turned = (roll_later - roll + 180) % 360 - 180
    assert abs(turned) * 6 == pytest.approx(expected, rel=1e-3)
    # Upright: up in the image stays towards the zenith.
    for rotation, time_s in ((at_start, 0.0), (later, 600.0)):
        side = rotation @ scene.atmosphere.zenith(time_s)
        assert side[0] == pytest.approx(0, abs=1e-3)
        assert abs(side[1]) == pytest.approx(np.sin(np.radians(45)), abs=2e-3)


@pytest.mark.skipif(find_compiler() is None, reason="needs the compiled FPGA")
@pytest.mark.slow
def test_quick_run_sees_the_field_turn() -> None:
    found = perform(Job("cubestar", "celestial", "extended", 1, 1.0))
    assert found["fields"] == 1
    assert max(found["ra"], found["dec"], found["roll"]) < 0.02
    assert found["turning"] == pytest.approx(-17.65, abs=0.01)
