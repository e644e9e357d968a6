"""What is described of the keys of scene files is what loading a file takes."""

import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.scene_file import load_scene, sky_keys
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN
from cubestack.emulator.camera.ov7620.scene_file import earth_sun_keys, load_earth_sun_scene
from cubestack.emulator.scene.file import SceneError, toml_text
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, SKY_HAZARDS
from tests.tiers import quick_ones

from ..camera.conftest import save

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
HUGE = 1e9

Described = dict[str, Any]
Within = Callable[[Any], dict[str, Any]]


def load(folder: Path, kind: str, table: dict[str, Any]) -> Any:
    path = save(folder, toml_text({"kind": kind, **BASE[kind], **table}))
    return load_scene(path, CONDITION, UNCERTAIN) if kind == "sky" else load_earth_sun_scene(path)


def complaint(folder: Path, kind: str, table: dict[str, Any]) -> str:
    try:
        load(folder, kind, table)
    except SceneError as error:
        return str(error)
    return ""


def every(
    keys: dict[str, Described], within: Within = lambda table: table
) -> Iterator[tuple[str, Described, Within]]:
    """Name and description of each key, and what makes a scene's table of its value."""
    for name, key in keys.items():
        needed = NEEDED.get(name, {})

        def alone(value: Any, name: str = name) -> dict[str, Any]:
            return within({name: value})

        yield name, key, alone
        if "kinds" in key:
            for kind, one in key["kinds"].items():
                yield from every(
                    one["keys"],
                    lambda t, k=kind, n=name: within({n: {k: t}}),  # type: ignore[misc]
                )
        elif "keys" in key:
            yield from every(
                key["keys"],
                lambda t, m=key["type"] == "tables", n=name, f=needed: within(  # type: ignore[misc]
                    {n: [f | t] if m else f | t}
                ),
            )


def numbers(kind: str) -> Iterator[tuple[str, Described, Callable[[float], dict[str, Any]]]]:
    """Name and description of each number, and of those in lists, and what makes a table of it."""
    for name, key, table in every(KINDS[kind]):
        of = key["of"] if key["type"] == "list" else key
        if of["type"] in ("number", "whole"):

            def filled(value: float, key: Described = key, of: Described = of, t: Within = table):
                value = int(value) if of["type"] == "whole" else value
                return t([value] * (key["count"] or 3) if of is not key else value)

            yield name, of, filled


@pytest.mark.parametrize("kind", BASE)
def test_rejects_every_key_beyond_its_limits_by_name(tmp_path: Path, kind: str) -> None:
    tried = 0
    for name, key, table in numbers(kind):
        for end, step in (("low", -1), ("high", 1)):
            if end in key:
                beyond = key[end] + step * max(1, abs(key[end]) / 2**50)
                with pytest.raises(SceneError, match=rf"\b{name}\b.* must be .*, not "):
                    load(tmp_path, kind, table(beyond))
                tried += 1
    assert tried >= {"sky": 80, "earth-sun": 80, "ball": 9}[kind]


@pytest.mark.parametrize("kind", BASE)
def test_rejects_every_key_of_another_type_by_name(tmp_path: Path, kind: str) -> None:
    for name, key, table in every(KINDS[kind]):
        wrong = {"flag": (0, "true"), "whole": (1.5, True), "number": ("1", True)}
        for value in wrong.get(key["type"], (1,)):
            said = complaint(tmp_path, kind, table(value))
            assert f"{name} must be " in said, said


@pytest.mark.parametrize("kind", quick_ones(BASE, "earth-sun"))
def test_scene_keys_tolerate_or_reject_huge_numbers(tmp_path: Path, kind: str) -> None:
    """A huge one is rejected by its name, or by that of what follows from it, or does no harm."""
    for name, _key, table in numbers(kind):
        for value in (HUGE, -HUGE):
            said = complaint(tmp_path, kind, table(value))
            assert not said or any(word in said for word in (name, "optics", "poses", "altitude"))


@pytest.mark.parametrize("kind", quick_ones(BASE, "sky"))
def test_scene_keys_accept_their_limits(tmp_path: Path, kind: str) -> None:
    for name, key, table in numbers(kind):
        for limit in (key[end] for end in ("low", "high") if end in key):
            said = complaint(tmp_path, kind, table(limit))  # of another key, or that 0 is too small
            assert f"{name} must be {key['low']:.10g} to" not in said


def test_scene_key_defaults_match_a_file_without_those_keys(tmp_path: Path) -> None:
    for kind in BASE:
        view = load(tmp_path, kind, {})
        for name, key in KINDS[kind].items():
            owner = next((one for one in (view.scene, view.condition) if hasattr(one, name)), None)
            if owner is None or key["type"] in ("table", "tables", "kinds"):
                continue
            if key["default"] is not None:
                np.testing.assert_array_equal(getattr(owner, name), key["default"], name)
    assert KINDS["sky"]["optics"]["keys"]["cx"]["default"] == LENS.cx
    assert KINDS["sky"]["optics"]["keys"]["distortion"]["choices"] == ["inverse", "toolbox"]


def test_every_key_has_a_meaning_and_a_type() -> None:
    for kind, keys in KINDS.items():
        for name, key, _ in every(keys):
            assert key["meaning"], f"{kind}: {name}"
            types = "number whole flag text moment choice list table tables kinds"
            assert key["type"] in types.split()
    assert set(KINDS["sky"]["hazards"]["kinds"]) >= set(SKY_HAZARDS)
    assert set(KINDS["earth-sun"]["hazards"]["kinds"]) >= {*SKY_HAZARDS, *EARTH_HAZARDS}
    assert not set(SKY_HAZARDS) & set(KINDS["picture"]["hazards"]["kinds"])


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"kind": "sky", "ra_deg": 83.8, "count": -3, "noise": False, "list": [1, 2.5]},
        {"small": 1e-7, "large": 1e300, "pairs": [[40.0, 0.1], [70.0, 0.4]], "none": []},
        {"atmosphere": {"latitude_deg": -33.9}, "after": 1},
        {"poses": [{"at_s": 1.0, "rate_deg_s": [0.0, 1.0, 0.0]}, {"at_s": 2.0}]},
        {"hazards": {"sun-glare": [{"direction": [1.0, 2.0]}], "moon": {"scatter": 0.1}}},
        {"empty": {}, "key with blanks": {'"quoted"': 1}, "line\nend": 2},
        {"text": 'quotes " and \\ and \x00 \x7f \n é 😀 ]\n[hazards]'},
    ],
)
def test_toml_text_round_trips(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_utc_text_is_written_as_a_toml_datetime() -> None:
    (moment,) = tomllib.loads(toml_text({"utc": "2013-02-01T20:00:00Z"})).values()
    assert moment.isoformat() == "2013-02-01T20:00:00+00:00"


@pytest.mark.parametrize("value", [None, float("inf"), float("nan"), object(), [None], [{}, 1]])
def test_rejects_values_that_toml_cannot_store(value: Any) -> None:
    with pytest.raises(SceneError, match="a scene file can not contain the value"):
        toml_text({"key": value})
