import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import matrix_from_pointing
from cubestack.host.devices.registry import device, device_names
from cubestack.host.emulation.emulated import open_device
from cubestack.host.errors import TargetError
from cubestack.host.ground import scenes
from cubestack.host.ground.scenes import magnitude

from .conftest import Controlled

SCENE = "/devices/cubestar/scene"


def show(controlled: Controlled, table: dict[str, Any]) -> tuple[int, Any]:
    body = {"words": ["scene", "scene"], "text": scenes.text_of(table)}
    return controlled.ask("POST", "/devices/cubestar/act", body)


def test_scene_keys_call_describes_the_scene_kinds(controlled: Controlled) -> None:
    status, told = controlled.ask("GET", f"{SCENE}/keys")
    assert status == 200
    assert list(told["kinds"]) == ["sky", "picture"]
    epoch = told["kinds"]["sky"]["epoch"]
    assert (epoch["type"], epoch["low"], epoch["high"]) == ("number", 1800, 2200)


def test_present_scene_round_trips(controlled: Controlled) -> None:
    table = controlled.ask("GET", SCENE)[1]["table"]
    assert (table["kind"], table["ra_deg"], table["mag_limit"]) == ("sky", 84.0, 3.8)
    other = table | {"ra_deg": 120.0, "hazards": {"moon": [{"direction": [120.0, 10.0]}]}}
    before = controlled.emulated.scene
    assert show(controlled, other)[0] == 200
    assert controlled.emulated.scene is not before
    status, told = controlled.ask("GET", SCENE)
    assert (status, told["table"]["ra_deg"]) == (200, 120.0)
    assert [one["name"] for one in told["sight"]["bodies"]] == ["Moon"]
    assert show(controlled, told["table"])[0] == 200
    again = controlled.ask("GET", SCENE)[1]
    assert (again["table"], again["follows"]) == (told["table"], "")
    controlled.emulated.follows = "an orbit"
    assert controlled.ask("GET", SCENE)[1]["follows"] == "an orbit"


def test_look_does_not_change_the_scene(controlled: Controlled) -> None:
    before = controlled.emulated.scene
    table = {"kind": "sky", "ra_deg": 10.0, "dec_deg": 20.0, "roll_deg": 30.0}
    status, told = controlled.ask("POST", f"{SCENE}/look", {"table": table})
    assert status == 200
    (field,) = told["sight"]["fields"]
    np.testing.assert_allclose(field["axes"], matrix_from_pointing(10, 20, 30), atol=1e-8)
    assert controlled.emulated.scene is before


@pytest.mark.parametrize(
    ("table", "error"),
    [
        ({}, 'scene: kind must be "sky" or "picture", not None'),
        ({"kind": "sky", "ra_deg": 400, "dec_deg": 0}, "scene: ra_deg must be -360 to 360"),
        ({"kind": "sky", "ra_deg": 1, "dec_deg": 0, "<b>": 1}, "scene: unknown key '<b>'"),
        ({"kind": "sky", "ra_deg": None}, "a scene file can not contain the value None"),
        ({"kind": "sky", "a\nb": {"c": 1}}, "scene: unknown key 'a\\nb'"),
        ({"kind": "sky", "ra_deg": "\ud800", "dec_deg": 1}, "is not valid Unicode"),
        ({"kind": "picture", "file": "/none.png"}, "scene: the file none.png did not come with"),
        (
            {"kind": "sky", "ra_deg": 1, "dec_deg": 0, "hazards": {"moon": [{"scatter": 1}]}},
            "scatter must be 0 to 0.2, not 1",
        ),
    ],
)
def test_invalid_scene_is_rejected_in_one_line(
    controlled: Controlled, table: dict[str, Any], error: str
) -> None:
    status, told = controlled.ask("POST", f"{SCENE}/look", {"table": table})
    assert status == 400
    assert error in told["error"]
    assert "\n" not in told["error"]


def test_stars_match_the_catalogue(controlled: Controlled) -> None:
    status, told = controlled.ask("GET", "/stars?mag_limit=2")
    stars = told["stars"]
    assert status == 200
    assert (stars[0]["name"], stars[0]["v_mag"]) == ("Sirius", -1.44)
    assert stars[0]["ra_deg"] == pytest.approx(101.28, abs=0.02)
    assert stars[0]["dec_deg"] == pytest.approx(-16.72, abs=0.01)
    magnitudes = [star["v_mag"] for star in stars]
    assert magnitudes == sorted(magnitudes)
    assert max(magnitudes) < 2
    polaris = next(star for star in told["stars"] if star["name"] == "Polaris")
    assert polaris["dec_deg"] > 89
    for wrong in ("mag_limit=12", "mag_limit=nan", "epoch=1000", "epoch=x"):
        assert controlled.ask("GET", f"/stars?{wrong}")[0] == 400


@pytest.mark.parametrize("name", device_names())
def test_default_scene_of_every_device_round_trips(name: str) -> None:
    with open_device(name) as emulated:
        told = scenes.present(emulated)
        json.dumps(told | scenes.keys(emulated.device), allow_nan=False)
        again = scenes.look(emulated, told["table"])
    for one, other in zip(told["sight"]["fields"], again["sight"]["fields"], strict=True):
        assert one["name"] == other["name"]
        np.testing.assert_allclose(one["axes"], other["axes"], atol=1e-5)


def test_rejects_a_device_without_scene_form() -> None:
    none = replace(device("cubestar"), scene_form=None)
    with pytest.raises(TargetError, match="CubeStar declares no scene keys"):
        scenes.keys(none)


def test_magnitudes_match_the_catalogue() -> None:
    for hipparcos, v_mag in ((32349, -1.44), (11767, 1.97), (78727, 4.16)):
        assert magnitude(hipparcos) == pytest.approx(v_mag, abs=0.05)
    assert magnitude(0) is magnitude(999_999) is None
