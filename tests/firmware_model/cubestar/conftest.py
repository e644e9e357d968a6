"""The program on fake hardware, and skies to look at."""

import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches

from .harness import Harness
from .sky import Sky, take


@pytest.fixture(scope="session")
def pose() -> Rotation:
    """An attitude, inertial to camera, with enough stars in view."""
    return Rotation.from_euler("zxz", [40, 65, -110], degrees=True)


@pytest.fixture(scope="session")
def sky(catalogue: StarCatalogue, pose: Rotation) -> Sky:
    return take(catalogue, pose)


@pytest.fixture
def unit(catalogue: StarCatalogue, profile: str) -> Harness:
    return Harness(catalogue, CubeStarSwitches.of(profile))


@pytest.fixture
def lit(unit: Harness, sky: Sky) -> Harness:
    """The program whose FPGA delivers the picture of ``sky``."""
    unit.picture = sky.picture
    return unit
