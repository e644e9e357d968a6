"""No number in a scene file is too large: it is refused with its key, or does no harm."""

import os
from collections.abc import Iterator
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.hazards import HAZARDS as SENSOR_HAZARDS
from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.mlx75412.lens import CONDITION, UNCERTAIN
from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, SKY_HAZARDS
from cubestack.emulator.scene.sky import MOST_FALSE_STARS, SkyScene

HUGE = (1e9, -1e9, 10**9, -(10**9))

#: Directions, of which the length does not count, and seeds.
ANY = {"nadir", "sun", "moon", "direction", "towards", "orbit_towards", "seed"}

SKY = {"ra_deg": 83.8, "dec_deg": -5.4}


def toml(kind: str, table: dict[str, Any], hazard: str = "") -> str:
    def text(value: Any) -> str:
        return f"[{', '.join(map(text, value))}]" if isinstance(value, list) else repr(value)

    lines = [f'kind = "{kind}"'] + [f"{key} = {text(one)}" for key, one in table.items()]
    if hazard:
        own = len(SKY) + 1 if kind == "sky" else 1
        lines.insert(own, f"[hazards.{hazard}]")
    return "\n".join(lines)


def scenes() -> Iterator[tuple[str, str, str]]:
    """Kind, key and file of scenes with one huge value each."""
    for huge in HUGE:
        for kind, scene, hazards, base in (
            ("sky", SkyScene, SKY_HAZARDS, SKY),
            ("earth-sun", EarthSunScene, EARTH_HAZARDS, dict[str, Any]()),
        ):
            keys = [*base, "roll_deg", *(one.name for one in fields(scene))]
            for key in keys + [one.name for one in fields(CONDITION)]:
                for value in (huge, [huge] * 2, [huge] * 3):
                    yield kind, key, toml(kind, base | {key: value})
            for name, hazard in {**hazards, **SENSOR_HAZARDS}.items():
                needed = {
                    one.name: 1
                    for one in fields(hazard)
                    if one.init and one.default is one.default_factory is MISSING
                }
                for one in fields(hazard):
                    for value in (huge, [huge] * 2, [huge] * 3):
                        table = base | needed | {one.name: value}
                        yield kind, one.name, toml(kind, table, name)


def test_huge_values_are_refused_with_their_key(tmp_path: Path) -> None:
    path, tried = tmp_path / "scene.toml", set[tuple[str, str]]()
    for kind, key, text in scenes():
        path.write_text(text)
        try:
            if kind == "sky":
                load_scene(path, CONDITION, UNCERTAIN)
            else:
                load_earth_sun_scene(path)
            said = f"{key} is any number's" if key in ANY else "nothing"
        except SceneError as error:
            said = str(error)
            tried.add((kind, key))
        assert key in said, text
    assert len(tried) > 40


def test_as_many_false_stars_as_there_may_be() -> None:
    sky = SkyScene([0, 0, 0, 1], false_stars=MOST_FALSE_STARS)
    places, magnitudes = sky.false_lights()
    assert len(places) == len(magnitudes) == MOST_FALSE_STARS
    assert np.all((places >= 0) & (places < 1))


@pytest.mark.parametrize(
    ("kind", "key", "inside", "outside"),
    [
        ("sky", "dec_deg", 90, 90.001),
        ("sky", "dec_deg", -90, -90.001),
        ("sky", "ra_deg", -360, -360.1),
        ("sky", "ra_deg", 360, 360.1),
        ("sky", "rate_deg_s", [100, -100, 100], [100.1, 0, 0]),
        ("sky", "epoch", 2200.0, 2200.1),
        ("sky", "epoch", 1800.0, 1799.9),
        ("sky", "false_stars", MOST_FALSE_STARS, MOST_FALSE_STARS + 1),
        ("sky", "false_stars", 0, -1),
        ("sky", "false_star_mag", [3.0, 3.0], [3.1, 3.0]),
        ("sky", "mag_limit", -30, -30.1),
        ("sky", "mag_limit", 30, 30.1),
        ("sky", "temperature_c", -60, -60.1),
        ("sky", "temperature_c", 125, 125.1),
        ("sky", "hot_pixels", 0, -1),
        ("sky", "seed", 0, -1),
        ("earth-sun", "altitude_km", 1e6, 1.1e6),
        ("earth-sun", "altitude_km", 1e-3, 0),
        ("earth-sun", "glow_km", 0, -0.1),
        ("earth-sun", "unevenness", 0, -0.1),
        ("earth-sun", "rate_deg_s", [0, -1000, 1000], [0, 0, -1000.1]),
        ("earth-sun", "temperature_c", -60, -60.1),
        ("earth-sun", "temperature_c", 125, 125.1),
        ("earth-sun", "hot_pixels", 0, -1),
        ("earth-sun", "hot_pairs", 0, -1),
        ("earth-sun", "bloom_px", 0.1, 0),
        ("earth-sun", "seed", 0, -1),
    ],
)
def test_the_limits_themselves_are_inside(
    kind: str, key: str, inside: Any, outside: Any, tmp_path: Path
) -> None:
    path = tmp_path / "scene.toml"

    def load(value: Any) -> Any:
        path.write_text(toml(kind, (SKY if kind == "sky" else {}) | {key: value}))
        return (
            load_scene(path, CONDITION, UNCERTAIN) if kind == "sky" else load_earth_sun_scene(path)
        )

    load(inside)
    with pytest.raises(
        SceneError, match=f"^{os.fspath(path)}: {key} must (not )?(be|fall).*, not "
    ):
        load(outside)
