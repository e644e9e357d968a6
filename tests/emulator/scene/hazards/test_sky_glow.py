import numpy as np
import pytest

from cubestack.emulator.scene.hazards import ephemeris, sky_glow
from cubestack.emulator.scene.hazards.contract import direction
from tests.emulator.scene.hazards.around import NOW

TABLE_16 = """\
- - - 2450 1260 770 500 215 117 78
- - - 2300 1200 740 490 212 117 78
- - 3700 1930 1070 675 460 206 116 78
9000 5300 2690 1450 870 590 410 196 114 78
5000 3500 1880 1100 710 495 355 185 110 77
3000 2210 1350 860 585 425 320 174 106 76
1940 1460 955 660 480 365 285 162 102 74
1290 990 710 530 400 310 250 151 98 73
925 735 545 415 325 264 220 140 94 72
710 570 435 345 278 228 195 130 91 70
395 345 275 228 190 163 143 105 81 67
264 248 210 177 153 134 118 91 73 64
202 196 176 151 130 115 103 81 67 62
166 164 154 133 117 104 93 75 64 60
147 145 138 120 108 98 88 70 60 58
140 139 130 115 105 95 86 70 60 57
140 139 129 116 107 99 91 75 62 56
153 150 140 129 118 110 102 81 64 56
180 166 152 139 127 116 105 82 65 56
"""
"""Leinert et al. 1998: the measurements of table 17 in S10, for the same places."""


def mag_arcsec2(hazard: sky_glow.SkyGlow, vector: np.ndarray) -> float:
    glow = hazard.glow(NOW, vector[None])
    return float(-2.5 * np.log10(glow[0] / 4.2545e10))


def test_ecliptic_pole_is_60_s10_or_v_23_3() -> None:
    pole = ephemeris.FROM_ECLIPTIC[:, 2]
    assert mag_arcsec2(sky_glow.SkyGlow(milky_way=0), pole) == pytest.approx(23.3, abs=0.05)


def test_zodiacal_light_matches_the_second_published_table() -> None:
    """Both tables are rounded, to three digits at most."""
    s10 = np.array([line.replace("-", "nan").split() for line in TABLE_16.splitlines()], float)
    s10 = np.column_stack([s10, np.full(len(s10), 60)])  # the pole's, which is not in the table
    axes = sky_glow.LONGITUDES_DEG, sky_glow.LATITUDES_DEG
    longitudes, latitudes = np.meshgrid(*axes, indexing="ij")
    known = np.isfinite(s10)
    found = sky_glow.zodiacal(longitudes[known].astype(float), latitudes[known].astype(float))
    np.testing.assert_allclose(found, s10[known], rtol=0.004, atol=0.4)


def test_zodiacal_light_has_no_steps() -> None:
    longitudes = np.linspace(15, 180, 3301)
    for latitude in (0.0, 7.0, 44.99, 45.01, 80.0):
        light = sky_glow.zodiacal(longitudes, np.full_like(longitudes, latitude))
        assert np.abs(np.diff(np.log(light))).max() < 0.01


def test_zodiacal_light_is_brighter_towards_the_sun() -> None:
    hazard = sky_glow.SkyGlow(milky_way=0, julian_date=ephemeris.NEW_YEAR_2026)
    sun = -ephemeris.heliocentric("earth", ephemeris.NEW_YEAR_2026)
    sun /= np.linalg.norm(sun)
    beside = np.cross(ephemeris.FROM_ECLIPTIC[:, 2], sun)
    near = np.cos(np.pi / 6) * sun + np.sin(np.pi / 6) * beside
    assert mag_arcsec2(hazard, near) == pytest.approx(27.78 - 2.5 * np.log10(1940), abs=0.03)


def test_milky_way_is_a_band_and_as_bright_as_published() -> None:
    pole = direction("pole", (192.85948, 27.12825))
    centre, away = direction("centre", (266.405, -28.936)), direction("away", (86.405, 28.936))
    found = sky_glow.milky_way(np.array([pole, centre, away]))
    np.testing.assert_allclose(found, [30, 640, 160], rtol=0.02)
    cygnus, lyra = direction("Cygnus", (305.0, 40.0)), direction("Bootes", (213.9, 19.2))
    in_it, beside = sky_glow.milky_way(np.array([cygnus, lyra]))
    assert in_it > 5 * beside


@pytest.mark.parametrize("away_deg", [15.0, 60.0, 180.0])
def test_sky_glow_is_sampled_at_a_longitude_from_the_sun(away_deg: float) -> None:
    for seed in range(4):
        hazard = sky_glow.SkyGlow.sample(away_deg, NOW, np.random.default_rng(seed))
        x, y, _ = NOW.boresight @ ephemeris.FROM_ECLIPTIC
        from_sun = np.degrees(np.arctan2(y, x)) - ephemeris.sun_longitude_deg(hazard.julian_date)
        assert abs((from_sun + 180) % 360 - 180) == pytest.approx(away_deg, abs=0.01)
