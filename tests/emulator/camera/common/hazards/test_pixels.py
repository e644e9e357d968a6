import numpy as np
import pytest

from cubestack.emulator.camera.common.hazards.pixels import Response

SHAPE = (512, 1024)


def gain(hazard: Response) -> np.ndarray:
    field = hazard.response(SHAPE)
    assert field is not None
    return field


def test_response_differs_as_declared() -> None:
    field = gain(Response(percent=2.0, columns_percent=0.5, dust=0))
    assert field.mean() == pytest.approx(1, abs=1e-3)
    columns = field.mean(axis=0)
    assert columns.std() == pytest.approx(np.hypot(0.005, 0.02 / np.sqrt(512)), rel=0.1)
    assert (field - columns).std() == pytest.approx(0.02, rel=0.02)


def test_dust_casts_shadows_of_its_depth() -> None:
    # Nothing but shadows, the mean over what a grain covers.
    clean, dusty = (gain(Response(percent=4.0, dust=n, seed=3)) for n in (0, 40))
    shade = dusty / clean
    assert shade.max() == pytest.approx(1)
    assert 0.8 <= shade.min() < 0.85  # five times 4 %, the deepest of forty
    assert 0.001 < np.mean(shade < 0.98) < 0.05


def test_response_repeats_by_seed_and_is_never_negative() -> None:
    np.testing.assert_array_equal(gain(Response(seed=1)), gain(Response(seed=1)))
    assert np.any(gain(Response(seed=1)) != gain(Response(seed=2)))
    assert gain(Response(percent=30.0)).min() >= 0
