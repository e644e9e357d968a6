"""Pictures of the page of hazards are those of the present light."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.host.devices.registry import device
from cubestack.host.pictures.images import save_sample
from cubestack.host.studies.hazards.command import PICTURES, sample
from cubestack.host.studies.hazards.curves import devices_with_hazards, hazards_of

FOLDER = Path(__file__).parents[4] / "docs" / PICTURES
SEED = 1
ROOM = 6
"""Grey values by which versions of the JPEG library may differ."""

ALL = [(name, hazard) for name in devices_with_hazards() for hazard in hazards_of(device(name))]
QUICK = {("cubestar", "moon"), ("cubesense", "clouds"), ("aramis", "debris")}


@pytest.mark.parametrize(
    ("name", "hazard"),
    [pytest.param(*one, marks=() if one in QUICK else pytest.mark.slow) for one in ALL],
)
def test_stored_picture_equals_the_rendered_one(name: str, hazard: str) -> None:
    rendered = BytesIO()
    save_sample(sample(name, hazard, SEED), rendered)
    with Image.open(FOLDER / f"{hazard}-{name}.jpg") as stored, Image.open(rendered) as own:
        assert stored.size == own.size
        differs = np.abs(np.asarray(stored, int) - np.asarray(own, int)).max()
    assert differs <= ROOM, "`cubestack hazards --frames 8 --seed 1 --out docs` renews it"


def test_every_stored_picture_is_of_a_hazard() -> None:
    assert {path.name for path in FOLDER.glob("*.jpg")} == {f"{two}-{one}.jpg" for one, two in ALL}
