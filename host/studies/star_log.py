"""Identified stars that a star tracker in flight reports by telemetry, as a file for a calibration.

One line per image: a JSON list of ``[Hipparcos number, column, row]`` per star, in pixels.
"""

from pathlib import Path
from typing import Any

import numpy as np

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.formats.untrusted import LARGEST_TEXT, parse_json, read_lines
from cubestack.host.calibration.stars import Sight
from cubestack.host.errors import CameraFileError

FARTHEST_PX = 10_000.0  #: largest coordinate that is accepted


def load_sights(path: Path) -> list[Sight]:
    """The images of a file; empty lines are none. Raises CameraFileError."""
    sights = []
    for number, line in read_lines(path, LARGEST_TEXT, CameraFileError):
        place = f"{path}: line {number}"
        if line.strip():
            sights.append(_sight(parse_json(line, place, CameraFileError), place))
    return sights


def _sight(content: Any, place: str) -> Sight:
    sky = load_sky()
    if not isinstance(content, list) or not all(map(_is_star, content)):
        raise CameraFileError(f"{place} must be a list of [Hipparcos number, column, row]")
    named = {int(star[0]): star[1:] for star in content}
    rows = np.searchsorted(sky.hip, [*named])
    rows = np.minimum(rows, len(sky.hip) - 1)
    for number, row in zip(named, rows, strict=True):
        if sky.hip[row] != number:
            raise CameraFileError(f"{place}: the catalogue has no star {number}")
    return Sight(np.array([*named.values()], float).reshape(-1, 2), sky.vectors[rows])


def _is_star(value: Any) -> bool:
    if not isinstance(value, list) or [type(part) in (int, float) for part in value] != [True] * 3:
        return False
    number, column, row = value
    return isinstance(number, int) and max(abs(column), abs(row)) <= FARTHEST_PX
