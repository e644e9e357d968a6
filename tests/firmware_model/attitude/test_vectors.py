"""Cross products are those of NumPy, to the bit."""

import numpy as np

from cubestack.firmware_model.attitude.vectors import cross
from tests.together import together


@together("kind", [np.float32, np.float64])
@together(
    "shapes", [((3,), (3,)), ((9, 3), (9, 3)), ((3,), (9, 3)), ((9, 3), (3,)), ((5, 4, 3), (4, 3))]
)
def test_products_are_equal(shapes: tuple[tuple[int, ...], tuple[int, ...]], kind: type) -> None:
    rng = np.random.default_rng(1)
    a, b = (rng.standard_normal(shape).astype(kind) for shape in shapes)
    expected = np.cross(a, b)
    found = cross(a, b)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)
