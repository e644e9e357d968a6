"""Oracles: lenses with known parameters; limbs are cones rotated by scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.host.calibration.fisheye import Fisheye, fit_fisheye, limb_angles

TABLES = Fisheye(371.0, 236.0, (0.1036, 0.9953, 7.6076e-5, -2.5572e-6, 0.0), 2.9, 95.0)
RIM = 95 * 2.9
#: Another polynomial with the published rim.
CUBE = (np.polyval(TABLES.factors[::-1], RIM) - 1.003 * RIM - 3e-5 * RIM**2) / RIM**3
TRUE = Fisheye(371.4, 235.7, (0.0, 1.003, 3e-5, CUBE, 0.0), 2.9, 95.0)
ANGLES = np.array([[a, b] for a in range(-35, 66, 20) for b in range(-55, 36, 20)], float)


def test_fits_axis_and_polynomial_from_lights() -> None:
    fit = fit_fisheye(TRUE.project(ANGLES), lambda _: ANGLES, TABLES, outline=False)
    assert (fit.lens.x_px, fit.lens.y_px) == pytest.approx((TRUE.x_px, TRUE.y_px), abs=0.01)
    np.testing.assert_allclose(fit.lens.project(ANGLES), TRUE.project(ANGLES), atol=0.05)
    assert fit.after_px < 0.03 < 0.4 < fit.before_px
    rim = np.array([[95.0, 0.0]])
    np.testing.assert_allclose(
        fit.lens.project(rim), np.add(TABLES.project(rim), (0.4, -0.3)), atol=0.1
    )


def limb(radius_deg: float, centre_deg: tuple[float, float]) -> np.ndarray:
    """Angles (n, 2) all around a circle in the sky."""
    around = np.radians(np.arange(0, 360, 20))
    cone = np.radians(radius_deg)
    ring = np.sin(cone) * np.stack([np.cos(around), np.sin(around)])
    circle = np.vstack([ring, np.full(len(around), np.cos(cone))]).T
    a, b = np.radians(centre_deg)
    x, y, z = Rotation.from_rotvec([-b, a, 0]).apply(circle).T
    return np.degrees(np.arctan2(np.hypot(x, y), z) / np.hypot(x, y))[:, None] * np.stack([x, y], 1)


def test_fits_axis_and_polynomial_from_limbs() -> None:
    centres = [(0.0, 0.0), (25.0, 0.0), (-10.0, 20.0), (0.0, -28.0), (-22.0, -5.0)]
    angles = [limb(63.48, centre) for centre in centres]
    at = np.concatenate(
        [np.full((len(points), 2), c) for points, c in zip(angles, centres, strict=True)]
    )
    pixels = TRUE.project(np.concatenate(angles))
    azimuths = np.arctan2(*np.concatenate(angles).T[::-1])
    np.testing.assert_allclose(limb_angles(azimuths, at, 63.48), np.concatenate(angles), atol=1e-9)
    fit = fit_fisheye(pixels, lambda phi: limb_angles(phi, at, 63.48), TABLES, outline=True)
    assert (fit.lens.x_px, fit.lens.y_px) == pytest.approx((TRUE.x_px, TRUE.y_px), abs=0.03)
    assert fit.after_px < 0.03 < 0.3 < fit.before_px


def test_rejects_fewer_than_8_lights() -> None:
    with pytest.raises(ValueError, match="needs 8 places at least; 7 were found"):
        fit_fisheye(TRUE.project(ANGLES[:7]), lambda _: ANGLES[:7], TABLES, outline=False)
