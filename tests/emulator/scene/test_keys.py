"""What is told of the keys of scene files is what their readers take."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.scene_file import load_scene, sky_keys
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN
from cubestack.emulator.camera.ov7620.scene_file import earth_sun_keys, load_earth_sun_scene
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, SKY_HAZARDS
from cubestack.emulator.scene.keys import Told
from cubestack.emulator.scene.toml_text import toml_text

KINDS = {**sky_keys(CONDITION, UNCERTAIN), **earth_sun_keys()}
BASE: dict[str, dict[str, Any]] = {
    "sky": {"ra_deg": 1.0, "dec_deg": 2.0},
    "earth-sun": {},
    "ball": {},
}
#: What a table needs beside the key that is tried.
NEEDED: dict[str, dict[str, Any]] = {
    "atmosphere": {"latitude_deg": 1.0, "sidereal_deg": 2.0},
    "reflections": {"camera": "sun", "at_deg": [0.0, 0.0], "radius_px": 1.0, "level": 1.0},
    "nadir_camera": {"boresight": [0.0, 0.0, 1.0]},
    "sun_camera": {"boresight": [0.0, 0.0, -1.0]},
}


def load(folder: Path, kind: str, table: dict[str, Any]) -> Any:
    path = folder / "scene.toml"
    path.write_text(toml_text({"kind": kind, **BASE[kind], **table}), "utf-8")
    reader: Callable[[Path], Any] = (
        (lambda one: load_scene(one, CONDITION, UNCERTAIN))
        if kind == "sky"
        else load_earth_sun_scene
    )
    return reader(path)


def every(
    keys: dict[str, Told], within: Callable[[Any], dict[str, Any]] = lambda table: table
) -> Iterator[tuple[str, Told, Callable[[Any], dict[str, Any]]]]:
    """Name of each key, what is told of it, and what makes a scene's table of its value."""
    for name, told in keys.items():
        needed = NEEDED.get(name, {})

        def alone(value: Any, name: str = name) -> dict[str, Any]:
            return within({name: value})

        yield name, told, alone
        if "kinds" in told:
            for kind, one in told["kinds"].items():
                yield from every(
                    one["keys"],
                    lambda t, k=kind, n=name: within({n: {k: t}}),  # type: ignore[misc]
                )
        elif "keys" in told:
            yield from every(
                told["keys"],
                lambda t, m=told["type"] == "tables", n=name, f=needed: within(  # type: ignore[misc]
                    {n: [f | t] if m else f | t}
                ),
            )


def number_keys() -> Iterator[Any]:
    for kind in BASE:
        for name, told, table in every(KINDS[kind]):
            of = told if told["type"] != "list" else {**told["of"], **told}
            for end in ("low", "high"):
                if end in of and of.get(end) is not None:
                    yield pytest.param(kind, told, table, of[end], end, id=f"{kind}-{name}-{end}")


def filled(told: Told, value: Any) -> Any:
    """As one value of this key, or all of its list."""
    if told["type"] != "list":
        return int(value) if told["type"] == "whole" else value
    return [value] * told["count"]


@pytest.mark.parametrize(("kind", "told", "table", "limit", "end"), [*number_keys()])
def test_beyond_its_limits_a_key_is_refused(
    tmp_path: Path, kind: str, told: Told, table: Any, limit: float, end: str
) -> None:
    beyond = limit + (1 if end == "high" else -1) * max(1, abs(limit) / 2**50)
    with pytest.raises((SceneError, ValueError)):
        load(tmp_path, kind, table(filled(told, beyond)))


def test_limits_of_hazards_and_scenes_are_told() -> None:
    sky = KINDS["sky"]
    assert (sky["epoch"]["low"], sky["epoch"]["high"]) == (1800, 2200)
    assert sky["rate_deg_s"]["of"]["high"] == 100
    assert sky["temperature_c"]["high"] == 125
    assert sky["atmosphere"]["keys"]["latitude_deg"]["low"] == -90
    assert sky["hazards"]["kinds"]["moon"]["keys"]["scatter"]["high"] == 0.2
    assert KINDS["earth-sun"]["altitude_km"]["high"] == 1e6


def test_defaults_are_what_a_file_without_them_gives(tmp_path: Path) -> None:
    for kind in BASE:
        view = load(tmp_path, kind, {})
        for name, told in KINDS[kind].items():
            owner = next((one for one in (view.scene, view.condition) if hasattr(one, name)), None)
            if owner is None or told["type"] in ("table", "tables", "kinds"):
                continue
            if told["default"] is not None:
                np.testing.assert_array_equal(getattr(owner, name), told["default"], name)
    assert KINDS["sky"]["optics"]["keys"]["cx"]["default"] == LENS.cx
    assert KINDS["sky"]["optics"]["keys"]["distortion"]["choices"] == ["inverse", "toolbox"]


def test_every_key_says_what_it_is() -> None:
    for kind, keys in KINDS.items():
        for name, told, _ in every(keys):
            assert told["meaning"], f"{kind}: {name}"
            assert told["type"] in (
                *("number", "whole", "flag", "text", "moment", "choice"),
                *("list", "table", "tables", "kinds"),
            )
    assert set(KINDS["sky"]["hazards"]["kinds"]) >= set(SKY_HAZARDS)
    assert set(KINDS["earth-sun"]["hazards"]["kinds"]) >= {*SKY_HAZARDS, *EARTH_HAZARDS}
    assert not set(SKY_HAZARDS) & set(KINDS["picture"]["hazards"]["kinds"])
    assert KINDS["sky"]["atmosphere"]["keys"]["height_m"]["unit"] == "m"
    assert KINDS["sky"]["rate_deg_s"]["unit"] == "deg/s"
