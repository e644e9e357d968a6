import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.earth import EARTH_RADIUS_KM, Earth, angular_radius_deg

NADIR = np.array([0.0, 0.0, 1.0])
ABOVE = -NADIR  # the Sun in the zenith below the satellite
EYE = np.eye(3)


def earth(
    altitude_km: float = 750.0, unevenness: float = 0.0, glow_km: float = 0.0, seed: int = 0
) -> Earth:
    return Earth(altitude_km, unevenness, glow_km, seed)


def fan(angles_deg: np.ndarray, towards_deg: float = 0.0) -> np.ndarray:
    """Lines of sight at angles from the nadir, all to one side."""
    theta, phi = np.radians(angles_deg), np.radians(towards_deg)
    columns = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    return np.stack(columns, axis=1).astype(np.float32)


def radiance(
    body: Earth,
    vectors: np.ndarray,
    pixel_deg: float = 1e-3,
    nadir: np.ndarray = NADIR,
    sun: np.ndarray = ABOVE,
    axes: np.ndarray = EYE,
) -> np.ndarray:
    pixel_rad = np.full(len(vectors), np.radians(pixel_deg), np.float32)
    hit, light = body.radiance(vectors.astype(np.float32), pixel_rad, nadir, sun, axes)
    whole = np.zeros(len(vectors))
    whole[hit] = light
    return whole


def ray_and_sphere(
    vectors: np.ndarray, nadir: np.ndarray, altitude_km: float
) -> tuple[np.ndarray, np.ndarray]:
    """By the quadratic equation: which rays hit, and the surface normals (nan where none)."""
    centre = nadir * (EARTH_RADIUS_KM + altitude_km)
    b = vectors @ centre
    discriminant = b**2 - (centre @ centre - EARTH_RADIUS_KM**2)
    hits = (discriminant > 0) & (b > 0)
    distance = np.where(hits, b - np.sqrt(np.abs(discriminant)), np.nan)
    return hits, (vectors * distance[:, None] - centre) / EARTH_RADIUS_KM


@pytest.mark.parametrize("altitude", [200.0, 750.0, 36_000.0])
def test_earth_radiance_equals_a_ray_sphere_intersection(altitude: float) -> None:
    generator = np.random.default_rng(3)
    nadir, sun = generator.standard_normal((2, 3))
    nadir, sun = nadir / np.linalg.norm(nadir), sun / np.linalg.norm(sun)
    vectors = generator.standard_normal((20_000, 3)) + (2 * nadir if altitude > 10_000 else 0)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    hits, normals = ray_and_sphere(vectors, nadir, altitude)
    light = radiance(earth(altitude_km=altitude), vectors, 1e-3, nadir, sun)
    away = np.degrees(np.arccos(vectors @ nadir)) - angular_radius_deg(altitude)
    clear = np.abs(away) > 0.01
    assert clear.sum() > 19_000
    assert hits.sum() > 100
    assert np.all(light[clear & ~hits] == 0)
    light, day = light[clear & hits], normals[clear & hits] @ sun
    assert np.all(light > 0)
    high = day > 0.3  # far from the terminator: the cosine law
    np.testing.assert_allclose(light[high], day[high], rtol=0.01, atol=1e-3)
    assert np.all(light[day < -0.3] < 0.005)


def test_earth_limb_at_750_km_is_at_63_48_deg() -> None:
    assert angular_radius_deg(750.0) == pytest.approx(63.48, abs=0.005)  # published
    angles = np.linspace(63, 64, 1001)
    light = radiance(earth(), fan(angles))
    assert angles[np.flatnonzero(light)[-1]] == pytest.approx(63.48, abs=0.005)


def test_light_fades_through_the_terminator() -> None:
    # The Sun on the horizon below the satellite: day towards it, night on the other side.
    light = radiance(earth(), fan(np.linspace(-60, 60, 241)), sun=np.array([1.0, 0.0, 0.0]))
    assert np.all(np.diff(light) > 0)
    assert light[0] < 0.005
    assert light[120] == pytest.approx(0.025, abs=0.001)  # half the twilight at the horizon
    assert light[-1] > 0.25


def test_earth_glow_decays_with_ray_height() -> None:
    angles = np.linspace(63.49, 65, 200)
    ray = fan(angles).astype(np.float64)
    centre = NADIR * (EARTH_RADIUS_KM + 750)
    height = np.linalg.norm(np.cross(ray, centre), axis=1) - EARTH_RADIUS_KM
    light = radiance(earth(glow_km=10.0), fan(angles))
    near = height < 75
    expected = np.exp((height[0] - height[near]) / 10)
    np.testing.assert_allclose(light[near] / light[0], expected, atol=0.003)
    assert np.all(light[height > 90] == 0)
    # By night there is none.
    assert radiance(earth(glow_km=10.0), fan(angles), sun=NADIR).max() < 0.005


@pytest.mark.parametrize("glow_km", [0.0, 10.0])
def test_limb_pixel_is_the_mean_radiance_over_its_width(glow_km: float) -> None:
    body = earth(glow_km=glow_km)
    fine = np.arange(61.0, 66.0, 0.001)
    sharp = radiance(body, fan(fine))
    for centre in (63.1, 63.3, 63.5, 63.7, 64.0):
        inside = np.abs(fine - centre) < 0.2
        blurred = radiance(body, fan(np.array([centre])), 0.4)[0]
        assert blurred == pytest.approx(sharp[inside].mean(), abs=0.01)


def test_earth_radiance_is_rotation_invariant() -> None:
    generator = np.random.default_rng(8)
    vectors = generator.standard_normal((5000, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    sun = np.array([0.6, 0.0, -0.8])
    body = earth(unevenness=0.3, glow_km=10.0, seed=4)
    turn = Rotation.random(random_state=7)
    before = radiance(body, vectors, 0.4, NADIR, sun, EYE)
    after = radiance(
        body, turn.apply(vectors), 0.4, turn.apply(NADIR), turn.apply(sun), turn.as_matrix()
    )
    assert before.max() > 0.5
    np.testing.assert_allclose(after, before, atol=2e-3)
    # The surface stands still while the satellite turns, and does not when it should not.
    assert np.abs(radiance(body, vectors, 0.4, NADIR, sun, turn.as_matrix()) - before).max() > 0.1


def test_surface_roughness_is_seeded_and_of_the_requested_size() -> None:
    # From far away, so that many waves fit in.
    vectors = np.concatenate([fan(np.linspace(0, 8, 400), phi) for phi in range(0, 360, 10)])
    even = radiance(earth(altitude_km=36_000.0), vectors)
    one, same, other = (
        radiance(earth(altitude_km=36_000.0, unevenness=0.2, seed=seed), vectors)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.1
    ratio = one[even > 0.3] / even[even > 0.3]
    assert ratio.std() == pytest.approx(0.2, rel=0.25)
    assert ratio.mean() == pytest.approx(1.0, abs=0.08)
    assert radiance(earth(unevenness=3.0), fan(np.linspace(0, 60, 500))).min() == 0
