"""Pictures that a star camera took in orbit, solved from their pixels.

752 x 290, rows doubled. The camera is a CCD with pixels of 8.6 by 8.3 um behind 20 mm.
"""

import json
from dataclasses import replace
from math import atan, degrees
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters
from cubestack.firmware_model.aramis.detection.mask import LevelHistory
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED, Configuration, solve
from cubestack.firmware_model.aramis.solution import Solution
from cubestack.firmware_model.interface.aramis import MeasurementOutcome
from cubestack.host.studies.aramis.sky import database, errors_deg, meter

FOLDER = Path(__file__).parents[4] / "shared" / "data" / "sky_narrow"
PICTURES = sorted(FOLDER.glob("*.png"))

pytestmark = pytest.mark.skipif(not PICTURES, reason="the pictures are not part of the project")

FIELD = CameraField(2 * degrees(atan(580 * 0.0083 / 2 / 20)), 752, 580, 0.0086, 0.0083, round=False)
ONBOARD = CatalogueParameters(fov_deg=18, epoch=2014.8)


def solved(
    path: Path, configuration: Configuration, aided: bool, exposure_rows: int | None = None
) -> tuple[Solution, Rotation]:
    image = json.loads((FOLDER / "truth.json").read_text())["images"][path.name]
    truth = Rotation.from_quat(image["quaternion_xyzw_inertial_to_camera"])
    with Image.open(path) as opened:
        picture = np.repeat(np.asarray(opened), 2, axis=0)
    hint = truth.inv().apply([0.03, 0.02, 1.0]).astype(np.float32) if aided else None
    own = replace(configuration, field=FIELD)
    stars, past = database(ONBOARD), LevelHistory()
    return solve(picture, past, own, stars, meter(), hint, exposure_rows), truth


@pytest.mark.parametrize("path", PICTURES, ids=lambda path: str(path.stem))
@pytest.mark.parametrize("aided", [False, True])
def test_narrow_sky_images_are_solved(path: Path, aided: bool) -> None:
    solution, truth = solved(path, VERIFIED, aided)
    assert solution.outcome is MeasurementOutcome.CONCLUSIVE
    cross, roll = errors_deg(solution.quaternion, truth)
    assert cross < 0.05
    assert roll < 0.2


def test_spots_that_the_lens_draws_out_are_no_motion() -> None:
    """Their length over this exposure would be a shift of 4 px between the first row and the last.

    One picture is refused: its stars leave the turn about the boresight too uncertain.
    """
    pairs = [solved(path, VERIFIED, aided=False, exposure_rows=700) for path in PICTURES]
    found = [(one.quaternion, truth) for one, truth in pairs if one.quaternion is not None]
    assert len(found) >= 5
    assert all(errors_deg(quaternion, truth)[0] < 0.05 for quaternion, truth in found)


@pytest.mark.parametrize("aided", [False, True])
def test_published_profile_solves_most_sample_images(aided: bool) -> None:
    """Lost in space, one unique triangle of six is a wrong one: what verification is for."""
    pairs = [solved(path, PUBLISHED, aided) for path in PICTURES]
    found = [(one.quaternion, truth) for one, truth in pairs if one.quaternion is not None]
    right = sum(errors_deg(quaternion, truth)[0] < 0.05 for quaternion, truth in found)
    assert right >= 4
    assert len(found) - right <= (0 if aided else 1)
