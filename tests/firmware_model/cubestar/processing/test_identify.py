"""Which stars of the catalogue count where the boresight is about known."""

import numpy as np
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches

from ..harness import Harness
from ..sky import attitude_of, draw, error_deg


def test_hint_error_does_not_exclude_stars_in_the_far_corner(catalogue: StarCatalogue) -> None:
    """A corner is up to 29 deg from the boresight, and a hint may be 5 deg off (section 4.3.4)."""
    pose = Rotation.random(rng=np.random.default_rng(13))
    hinted = Rotation.from_euler("y", -4.8, degrees=True) * pose
    x, y, z = boresight = hinted.inv().as_matrix()[:, 2]
    far = catalogue.vectors @ boresight < np.cos(np.radians(25))
    seen = draw(catalogue.vectors[far], pose)
    unit = Harness(catalogue, CubeStarSwitches.of("extended"))
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    unit.command(
        "setTrackingMode",
        RightAscension=np.arctan2(y, x),
        Declination=np.arctan2(z, np.hypot(x, y)),
    )
    unit.picture = seen.picture
    unit.command("CaptureAndProcess")
    values = unit.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["Mode"]) == (True, MatchMode.ASSISTED)
    assert values["Matched"] == len(seen.stars) == 7
    assert error_deg(attitude_of(values), pose) < 0.02


def test_new_results_hold_no_stars() -> None:
    results = Results()
    assert (results.points.shape, results.vectors.shape) == ((0, 2), (0, 3))
    assert results.best == []
    assert results.detection is results.identification is None
