"""Pictures that a star camera took in orbit, shown to the emulated sensor.

The source is a CCD of 752 x 290 pixels of 8.6 x 8.3 um (rows doubled) behind a 20 mm lens. The
pictures are resampled to square pixels for a field of 18 deg; the margin stays dark.
"""

import json
from math import radians, tan
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.scene.attitude import attitude_error_deg
from tests.system.conftest import Measure

FOLDER = Path(__file__).parents[4] / "shared" / "data" / "sky_narrow"
PICTURES = sorted(FOLDER.glob("*.png"))
WIDTH_MM, HEIGHT_MM, FOCAL_MM = 752 * 0.0086, 580 * 0.0083, 20.0
FIELD_DEG = 18
PIXEL = 2 * tan(radians(FIELD_DEG / 2)) / 1024
"""Of the lens, as the tangent of an angle."""

pytestmark = pytest.mark.skipif(not PICTURES, reason="the pictures are not part of the project")


def drawn_anew(path: Path, folder: Path) -> Path:
    """The picture, resampled to the middle of 1280 x 1024 square pixels."""
    with Image.open(path) as opened:
        doubled = np.repeat(np.asarray(opened), 2, axis=0)
    # Even, so that its middle is the sensor's; the sizes are off by less than a thousandth.
    columns, rows = (2 * round(size / FOCAL_MM / PIXEL / 2) for size in (WIDTH_MM, HEIGHT_MM))
    inner = Image.fromarray(doubled).resize((columns, rows), Image.Resampling.BICUBIC)
    canvas = np.full((1024, 1280), np.median(doubled), np.uint8)
    top, left = (1024 - rows) // 2, (1280 - columns) // 2
    canvas[top : top + rows, left : left + columns] = np.asarray(inner)
    Image.fromarray(canvas).save(folder / path.name)
    return folder / path.name


def test_every_sample_image_is_solved(measure: Measure, tmp_path: Path) -> None:
    truths = json.loads((FOLDER / "truth.json").read_text())["images"]
    for path in PICTURES:
        picture = drawn_anew(path, tmp_path)
        (frame,) = measure("--image", picture, "--field", FIELD_DEG, "--profile", "extended")
        assert frame["outcome"] == "conclusive", path.name
        truth = np.array(truths[path.name]["quaternion_xyzw_inertial_to_camera"])
        cross, roll = attitude_error_deg(np.array(frame["quaternion"]), truth)
        assert cross < 0.05, path.name
        assert abs(roll) < 0.2, path.name
