"""Scenes of a running emulation as JSON: their keys, and their position on the sky."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from cubestack.emulator.scene.file import toml_text
from cubestack.emulator.scene.form import SceneForm
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.sky import EPOCHS
from cubestack.firmware_model.formats.setup import Document
from cubestack.host.devices.device import AnyDevice
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.errors import TargetError
from cubestack.host.pictures.overlay import is_named, star_name
from cubestack.host.recording.setups import written

JsonObject = dict[str, Any]

FILE = "scene"
"""Name of a scene without a file in messages."""

FAINTEST = 7.0
"""Highest V of listed stars; 15 000 are brighter."""


def keys(device: AnyDevice) -> JsonObject:
    """Keys of its scene files by kind; raises TargetError if it declares none."""
    return {"kinds": _form(device).keys}


def present(emulated: AnyEmulated) -> JsonObject:
    """The current scene: ``table`` of a scene file, ``sight`` on the sky, and ``follows``: what
    moves it, e.g. an orbit.
    """
    form = _form(emulated.device)
    view = form.view(emulated.board)
    sight = form.sky_map(view, emulated.board.kernel.now).as_dict()
    return {"table": form.table(view), "sight": sight, "follows": emulated.follows}


def look(emulated: AnyEmulated, table: Mapping[str, Any]) -> JsonObject:
    """The ``sight`` of a scene, without applying it; raises ValueError for an invalid table."""
    form = _form(emulated.device)
    with written(Document(FILE, text_of(table), emulated.files)) as path:
        view = emulated.device.load_scene(path)
    return {"sight": form.sky_map(view, emulated.board.kernel.now).as_dict()}


def text_of(table: Mapping[str, Any]) -> str:
    """The text of a scene file with ``table``; raises ValueError for unsupported values."""
    return toml_text(table)


@lru_cache(maxsize=8)
def stars(mag_limit: float, epoch: float) -> JsonObject:
    """Stars with V below ``mag_limit`` at the Julian year ``epoch``, brightest first.

    ``name`` may be empty. Raises ValueError if a value is out of range.
    """
    if not mag_limit <= FAINTEST:
        raise ValueError(f"mag_limit must be at most {FAINTEST:g}, not {mag_limit:g}")
    if not EPOCHS[0] <= epoch <= EPOCHS[1]:
        raise ValueError(f"epoch must be {EPOCHS[0]:g} to {EPOCHS[1]:g}, not {epoch:g}")
    sky = load_sky(epoch, mag_limit)
    order = np.argsort(sky.v_mag, kind="stable")
    x, y, z = sky.vectors[order].T
    ra, dec = np.degrees(np.arctan2(y, x)) % 360, np.degrees(np.arcsin(z))
    rows = zip(sky.hip[order].tolist(), ra, dec, sky.v_mag[order], strict=True)
    return {
        "stars": [
            {
                "name": star_name(hip) if is_named(hip) else "",
                "ra_deg": round(float(ra_deg), 4),
                "dec_deg": round(float(dec_deg), 4),
                "v_mag": round(float(v_mag), 2),
            }
            for hip, ra_deg, dec_deg, v_mag in rows
        ]
    }


def _form(device: AnyDevice) -> SceneForm[Any]:
    if device.scene_form is None:
        raise TargetError(f"{device.title} declares no scene keys")
    return device.scene_form()


@lru_cache(maxsize=4096)
def magnitude(hipparcos: int) -> float | None:
    """V of a star by its Hipparcos number; None if the catalogue does not have it."""
    sky = load_sky()
    at = int(sky.hip.searchsorted(hipparcos))
    known = at < len(sky) and sky.hip[at] == hipparcos
    return round(float(sky.v_mag[at]), 2) if known else None
