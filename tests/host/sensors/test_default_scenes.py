import numpy as np
import pytest

from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.host.devices.registry import device

ALNILAM_DEG = 84.05, -1.20
"""Right ascension and declination of the belt's middle star."""


@pytest.mark.parametrize("name", ["cubestar", "aramis"])
def test_star_trackers_point_at_orions_belt_with_north_up(name: str) -> None:
    axes = matrix_from_quaternion(device(name).default_scene().quaternion)
    ra, dec = np.radians(ALNILAM_DEG)
    star = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    assert np.degrees(np.arccos(axes[2] @ star)) < 0.25
    assert axes @ (0, 0, 1) == pytest.approx((0, -1, 0), abs=0.02)


def test_cubesense_default_scene_matches_the_tutorial() -> None:
    scene = device("cubesense").default_scene()
    for target, angles_deg in (
        (CameraTarget.SUN, (20.0, 10.0)),
        (CameraTarget.NADIR, (-8.0, 12.0)),
    ):
        truth = scene.truth(target, 0)
        assert (truth.alpha_deg, truth.beta_deg) == pytest.approx(angles_deg)
