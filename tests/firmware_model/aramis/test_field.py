import numpy as np
import pytest
from scipy import integrate

from cubestack.firmware_model.aramis.field import CameraField

from .sky import meter, project, within

OBLONG = CameraField(13.7, 752, 580, 0.0086, 0.0083, round=False)
FIELDS = pytest.mark.parametrize("field", [CameraField(), CameraField(fov_deg=18), OBLONG])


@FIELDS
def test_directions_project_back(field: CameraField) -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 1, (500, 2)) * (field.columns - 1, field.rows - 1)
    directions = field.directions(points.astype(np.float32), meter())
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=2e-7)
    np.testing.assert_allclose(project(directions.astype(np.float64), field), points, atol=2e-3)


def test_the_shorter_side_spans_the_field() -> None:
    field = CameraField()
    edge = np.array([[639.5, -0.5], [639.5, 1023.5]], dtype=np.float32)
    top, bottom = field.directions(edge, meter()).astype(np.float64)
    assert np.degrees(np.arccos(top @ bottom)) == pytest.approx(21.53464, abs=1e-4)
    assert field.focal_length_mm == pytest.approx(14.0, abs=0.01)


@FIELDS
def test_three_ways_to_ask_what_is_in_the_field(field: CameraField) -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.2, 1.2, (2000, 2)) * (field.columns, field.rows)
    points = points[np.abs(np.hypot(*(points - field.centre).T) - 512) > 0.1]
    directions = field.directions(points.astype(np.float32), meter())
    expected = within(points, field)
    np.testing.assert_array_equal(field.inside(points.astype(np.float32), meter()), expected)
    np.testing.assert_array_equal(field.contains(directions, meter()), expected)
    assert not field.contains(-directions, meter()).any()


@FIELDS
def test_the_mask_is_the_field(field: CameraField) -> None:
    y, x = np.nonzero(field.mask)
    points = np.stack([x, y], axis=1).astype(np.float32)
    assert field.inside(points, meter()).all()
    assert field.pixels == len(points)
    assert not field.mask.flags.writeable


def test_solid_angles() -> None:
    x, y = np.array([OBLONG.columns, OBLONG.rows]) / 2 * OBLONG.scale
    exact = integrate.dblquad(lambda y, x: (1 + x * x + y * y) ** -1.5, -x, x, -y, y)[0]
    assert OBLONG.solid_angle_sr == pytest.approx(exact, rel=0.06)
    half = np.radians(21.53464 / 2)
    assert CameraField().solid_angle_sr == pytest.approx(2 * np.pi * (1 - np.cos(half)), rel=1e-4)
