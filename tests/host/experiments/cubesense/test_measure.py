import pytest

from cubestack.host.experiments.measure import measure


@pytest.mark.parametrize(
    ("sensor", "told", "other"), [("sun", "sun_pixels", "edges"), ("nadir", "edges", "sun_pixels")]
)
def test_each_sensor_has_its_own_column(sensor: str, told: str, other: str) -> None:
    (result,) = measure("cubesense", frames=1, sensor=sensor)
    assert result.sensor == sensor
    assert getattr(result, told) > 0
    assert getattr(result, other) is None
