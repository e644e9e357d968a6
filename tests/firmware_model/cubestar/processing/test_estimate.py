import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.estimate import by_errors
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.star_tracker.search import MatchOutcome

from ..sky import FOCAL_PX, meter

CAMERA = CameraParameters(6.28, FOCAL_PX, FOCAL_PX, 511.5, 255.5, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("identified", "believed"),
    [(0.997, 0.997), (0.999, 1.0), (1.0, 1.0), (1.001, 1.0), (1.003, 1.003)],
)
def test_accepts_focal_length_error_of_2_per_mille(identified: float, believed: float) -> None:
    """When the identification says so: these four stars alone would never prove it."""
    rng = np.random.default_rng(3)
    tangents = rng.uniform(-0.1, 0.1, (4, 2))
    true, seen = (np.column_stack([one, np.ones(4)]) for one in (tangents, identified * tangents))
    true, seen = (one / np.linalg.norm(one, axis=1)[:, None] for one in (true, seen))
    attitude = Rotation.random(rng=rng)
    estimate = by_errors(
        Results(vectors=seen.astype(np.float32)),
        Identification(
            np.arange(4, dtype=np.int32),
            np.full(4, 3, np.uint8),
            MatchOutcome.IDENTIFIED,
            scale=identified,
        ),
        attitude.inv().apply(true).astype(np.float32),
        CAMERA,
        meter(),
    )
    assert estimate.rating is not None
    assert estimate.rating.scale == pytest.approx(believed, abs=1e-5)
    assert np.abs(estimate.quaternion @ attitude.as_quat()) == pytest.approx(1, abs=1e-6)
