import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec import attitude_quality
from cubestack.firmware_model.interface.codec.message import Message


@given(st.integers(0, 2**32 - 1))
def test_a_covariance_comes_back_from_the_wire(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-6, -2, size=(3, 1))
    covariance = root @ root.T
    frame = Message(1, "Quality", "of a test").of(*attitude_quality.ATTITUDE_QUALITY)
    values = attitude_quality.UNRATED | attitude_quality.covariance_fields(covariance.tolist())
    read = np.array(attitude_quality.read_covariance(frame.unpack(frame.pack(**values))))
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.all(np.abs(read - covariance) <= 1e-6 * scale)


def test_what_is_not_rated_is_unknown() -> None:
    covariance = attitude_quality.read_covariance(attitude_quality.UNRATED)
    np.testing.assert_allclose(covariance, np.pi**2 * np.eye(3))


@pytest.mark.parametrize("wrong", [{"SigmaY": -1e-3}, {"CorrelationYZ": 1.25}, {"SigmaX": np.nan}])
def test_no_covariance(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="sigmas must be 0 or more and correlations within 1"):
        attitude_quality.read_covariance(attitude_quality.UNRATED | wrong)


def test_chance_that_vanishes_has_a_logarithm() -> None:
    assert attitude_quality.log_false_alarm(0.0) == -30
    assert attitude_quality.log_false_alarm(1e-4) == pytest.approx(-4)
