import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.common.scene_form import outline, sky_form
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
from cubestack.emulator.camera.ov7620.scene_form import earth_sun_form
from cubestack.emulator.scene.attitude import matrix_from_pointing
from cubestack.emulator.scene.file import toml_text
from cubestack.firmware_model.values import plain

from .conftest import save

DOCUMENT = Path(__file__).parents[3] / "docs" / "how-to" / "scenes.md"
EXAMPLES = [
    one
    for one in re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text("utf-8"), re.DOTALL)
    if "kind =" in one and '"picture"' not in one
]
HARD = """kind = "earth-sun"
moon = [0.2, 0.5, 1.0]
rate_deg_s = [0.0, 0.5, 0.0]
seed = 4
[nadir_camera]
boresight = [1.0, 0.0, 0.0]
right = [0.0, 1.0, 0.0]
[sun_lens]
centre_px = [1, -2]
radial_deg = [[40, 0.5], [60.0, 1]]
[hazards.terminator]
phase_deg = 60
[[hazards.debris]]
direction = [1, 0, 0]
towards = [0, 1, 0]
[[hazards.debris]]
direction = [90, 0]
seed = 7
[hazards.hot-pixels]
count = 30
"""
SKY, EARTH = sky_form(CONDITION, UNCERTAIN), earth_sun_form()


def load(path: Path) -> Any:
    sky = '"sky"' in path.read_text("utf-8").split("\n", 1)[0]
    return load_scene(path, CONDITION, UNCERTAIN) if sky else load_earth_sun_scene(path)


def same(one: Any, other: Any) -> bool:
    if is_dataclass(one):
        names = [entry.name for entry in fields(one) if entry.init]
        return type(one) is type(other) and all(
            same(getattr(one, name), getattr(other, name)) for name in names
        )
    if isinstance(one, tuple) and one and is_dataclass(one[0]):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray | tuple | float):
        return bool(np.allclose(np.asarray(one), np.asarray(other), rtol=0, atol=1e-6))
    return bool(one == other)


@pytest.mark.parametrize("text", [*EXAMPLES, HARD], ids=lambda text: text.split("\n")[0])
def test_saved_scene_loads_unchanged(tmp_path: Path, text: str) -> None:
    view = load(save(tmp_path, text))
    form: Any = SKY if hasattr(view.scene, "quaternion") else EARTH
    table = form.table(view)
    assert plain(list(table)) == list(table)
    again = load(save(tmp_path, toml_text(table)))
    for part in ("scene", "condition"):
        mine, other = getattr(view, part), getattr(again, part)
        for entry in fields(mine):
            assert same(getattr(mine, entry.name), getattr(other, entry.name)), entry.name
    assert set(table) - {"kind"} <= set(form.keys[table["kind"]])


def test_saves_only_values_that_differ_from_defaults(tmp_path: Path) -> None:
    text = 'kind = "sky"\nra_deg = 84.0\ndec_deg = -1.0\n[optics]\npsf_sigma_px = 2.0'
    assert SKY.table(load(save(tmp_path, text))) == {
        **{"kind": "sky", "ra_deg": 84.0, "dec_deg": -1.0, "roll_deg": 0.0},
        "optics": {"psf_sigma_px": 2.0},
    }
    table = EARTH.table(load(save(tmp_path, 'kind = "earth-sun"')))
    assert table == {"kind": "earth-sun", "nadir": [0, 0, 1], "sun": [0, 0, -1]}


def test_scene_table_contains_an_image_scene(tmp_path: Path) -> None:
    Image.new("L", (1100, 700), 9).save(tmp_path / "p.png")
    text = 'kind = "picture"\nfile = "p.png"\ncrop = [3, 4]\ntemperature_c = 3'
    table = SKY.table(load_scene(save(tmp_path, text), CONDITION))
    place = {"kind": "picture", "file": str(tmp_path / "p.png")}
    assert table == place | {"crop": [3, 4], "temperature_c": 3.0}


def test_sky_map_shows_the_field_where_the_camera_points(tmp_path: Path) -> None:
    text = 'kind = "sky"\nra_deg = 30\ndec_deg = 20\nroll_deg = 90\nrate_deg_s = [0, 1, 0]'
    view = load(save(tmp_path, text))
    sky_map = SKY.sky_map(view, 10 * 10**12)
    (field,), (now,) = sky_map.fields, sky_map.now
    np.testing.assert_allclose(field.axes, matrix_from_pointing(30, 20, 90), atol=1e-12)
    turned = np.degrees(np.arccos(field.axes[2] @ now.axes[2]))
    assert turned == pytest.approx(10)
    # At a roll of 90 deg the picture's up is east, so its longer side stands upright.
    spread = np.ptp(field.outline, axis=0)
    assert spread[2] > 1.5 * np.ptp(field.outline @ field.axes[1])
    assert not SKY.sky_map(view, 0).now
    assert sky_map.stars


def test_outline_is_the_border_of_the_image_or_of_the_round_field() -> None:
    border = outline(LENS)
    pixels = LENS.project(border)
    on_border = np.isclose(pixels[:, 0], -0.5) | np.isclose(pixels[:, 0], LENS.columns - 0.5)
    on_border |= np.isclose(pixels[:, 1], -0.5) | np.isclose(pixels[:, 1], LENS.rows - 0.5)
    assert on_border.all()
    round_field = np.degrees(np.arccos(outline(double_gauss())[:, 2]))
    assert round_field.max() == pytest.approx(double_gauss().field_stop_deg / 2)


def test_sky_map_shows_the_bodies_of_hazards(tmp_path: Path) -> None:
    text = (
        'kind = "sky"\nra_deg = 0\ndec_deg = 0\n[hazards.moon]\ndirection = [90, 0]\n'
        "[hazards.earth-limb]\nnadir = [0, -90]\nsun = [1, 0, 0]\naltitude_km = 750\n"
        "[hazards.sun-glare]\ndirection = [1, 0, 0]\n[hazards.planets]\n"
    )
    bodies = {one.name: one for one in SKY.sky_map(load(save(tmp_path, text)), 0).bodies}
    assert bodies.keys() >= {"Moon", "Earth", "Sun", "Venus"}
    np.testing.assert_allclose(bodies["Moon"].direction, [0, 1, 0], atol=1e-12)
    assert bodies["Earth"].radius_deg == pytest.approx(63.48, abs=0.01)
    np.testing.assert_allclose(bodies["Sun"].direction, [1, 0, 0])


def test_sky_map_shows_earth_and_sun_in_satellite_axes(tmp_path: Path) -> None:
    view = load(save(tmp_path, HARD))
    sky_map = EARTH.sky_map(view, 10**12)
    assert [one.name for one in sky_map.bodies[:3]] == ["Earth", "Sun", "Moon"]
    nadir = next(one for one in sky_map.fields if one.name == "nadir camera")
    np.testing.assert_allclose(nadir.axes[2], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(nadir.outline @ nadir.axes[2], np.cos(np.radians(95)))
    assert len(sky_map.now) == 2
    assert sky_map.turn @ np.array([0, 0, 1]) == pytest.approx([1, 0, 0])
    assert np.linalg.det(sky_map.turn) == pytest.approx(1)  # seen from inside, as the sky is
    assert not sky_map.stars
