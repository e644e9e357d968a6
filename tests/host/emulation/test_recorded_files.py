"""A recording has the files that it needs, and no path in it is opened."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.firmware_model.formats.recording import Control, load_recording
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.emulated import open_device
from cubestack.host.emulation.history import Recipe
from cubestack.host.emulation.records import start_recorder
from cubestack.host.recording.setups import emulated_setup, setup_for

SKY = 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n'
PICTURE = 'kind = "picture"\nfile = "{}"\n'


def recording(path: Path, *events: dict[str, Any], **setup: Any) -> Path:
    about = {"version": "0.2.0", "options": {"profile": "published"}, **setup}
    header = {"recording": 1, "device": "cubestar", "lines": {"uart": 57_600}, "setup": about}
    path.write_text("".join(json.dumps(one) + "\n" for one in (header, *events)))
    return path


def recipe(path: Path) -> Recipe:
    found = load_recording(path)
    setup = setup_for(found, seed=None, scene=None, faults=None, tell=lambda _: None)
    return Recipe.of(found, setup)


_opened: list[str] = []
_hooked: list[bool] = []


def _audit(name: str, arguments: tuple[object, ...]) -> None:
    if name == "open":
        _opened.append(str(arguments[0]))


@contextmanager
def opened_files() -> Iterator[list[str]]:
    """Paths that this process opens within the block."""
    if not _hooked:  # a hook cannot be removed
        sys.addaudithook(
            lambda name, args: _opened.append(str(args[0])) if name == "open" else None
        )
        _hooked.append(True)
    _opened.clear()
    yield _opened


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """A picture that no recording may reach, and a pipe on which a reader would wait."""
    path = tmp_path / "secret" / "picture.png"
    path.parent.mkdir()
    Image.fromarray(np.zeros((512, 1024), np.uint8)).save(path)
    os.mkfifo(path.parent / "pipe")
    return path


@pytest.mark.parametrize("name", ["{}", "../secret/picture.png", "{}/../pipe", "/dev/zero", ".."])
def test_scene_of_a_recording_opens_no_path(tmp_path: Path, secret: Path, name: str) -> None:
    name = name.format(secret)
    for scene in ({"name": name, "text": SKY}, {"name": "x", "text": PICTURE.format(name)}):
        path = recording(tmp_path / "some.rec", scene=scene)
        with opened_files() as opened:
            if scene["text"] == SKY:
                recipe(path)
            else:
                with pytest.raises(ValueError, match=r"did not come with|not a regular file"):
                    recipe(path)
        assert not [one for one in opened if "secret" in one or one.startswith("/dev/zero")]


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("firmware", one) for one in ("/etc/passwd", "/dev/zero", "x.elf#0123456789abcdef")),
        *(("gateware", one) for one in ("/etc/passwd", "os:system", "x.v")),
        ("semihosting_root", "/"),
    ],
)
def test_options_of_a_recording_open_no_path(tmp_path: Path, option: str, value: str) -> None:
    path = recording(tmp_path / "some.rec", options={option: value, "profile": "published"})
    with opened_files() as opened, pytest.raises(ValueError, match="--" + option.replace("_", "-")):
        recipe(path)
    assert not [one for one in opened if one.startswith(("/etc/passwd", "/dev/zero"))]


@pytest.mark.parametrize("value", [1, 1.5, True])
def test_options_of_a_recording_have_their_types(tmp_path: Path, value: object) -> None:
    path = recording(tmp_path / "some.rec", options={"firmware": value})
    with pytest.raises(ValueError, match="firmware must be a text"):
        recipe(path)


def test_command_of_a_message_opens_no_path(secret: Path) -> None:
    with open_device("cubestar", engine="python") as star:
        controls = EmulatedControls(star)
        for name, text in (
            (str(secret), SKY),
            (str(secret.parent / "pipe"), SKY),
            ("..", SKY),
            ("A" * 5000, SKY),
            ("a\0b", SKY),
        ):
            controls.act(Control(0, ("scene", name), text))
        with opened_files() as opened, pytest.raises(ValueError, match="did not come with"):
            controls.act(Control(0, ("scene", "x"), PICTURE.format(secret)))
        assert not [one for one in opened if "secret" in one]


def test_picture_of_a_scene_is_recorded_and_replayed(tmp_path: Path) -> None:
    """Also one that was loaded on the way, and with the files gone."""
    pixels = np.random.default_rng(1).integers(0, 255, (2, 512, 1024)).astype(np.uint8)
    scenes = [tmp_path / f"{number}.toml" for number in range(2)]
    for number, scene in enumerate(scenes):
        Image.fromarray(pixels[number]).save(tmp_path / f"{number}.png")
        scene.write_text(PICTURE.format(f"{number}.png"))
    path = tmp_path / "some.rec"
    with path.open("w") as stream, open_device("cubestar", scenes[0], engine="python") as star:
        recorder = start_recorder(star, stream, emulated_setup(0, scenes[0]))
        EmulatedControls(star).scene(scenes[1])
        recorder.close()
    for file in (*scenes, tmp_path / "0.png", tmp_path / "1.png"):
        file.unlink()
    found = load_recording(path)
    made = recipe(path).make("python")
    with made:
        assert np.array_equal(made.scene.pixels, pixels[0])
        (control,) = found.controls
        EmulatedControls(made).act(control)
        assert np.array_equal(made.scene.pixels, pixels[1])
        # A page changes the scene that it has, and names the same file.
        EmulatedControls(made).act(Control(0, ("scene", "x"), PICTURE.format("/gone/1.png")))
        with pytest.raises(ValueError, match=r"0.png did not come with"):
            EmulatedControls(made).act(Control(0, ("scene", "x"), PICTURE.format("0.png")))
