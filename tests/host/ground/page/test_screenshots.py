from typing import Any

import numpy as np
import pytest
from PIL import Image

from docs.make_ground import HEIGHT, IMAGES, SEED, WIDTH, drawn

from ..browser import shown, station

pytestmark = [pytest.mark.xdist_group("other pages"), pytest.mark.slow]

TOLERANCE = 6.0
"""Mean difference of grey values in 8 x 8 blocks: times and noise differ, the layout does not."""


def blocks(image: Image.Image) -> Any:
    grey = image.convert("L")
    return np.asarray(grey.resize((grey.width // 8, grey.height // 8)), float)


def test_screenshots_of_the_docs_show_the_present_page(chromium: Any) -> None:
    targets = ("emulated:cubestar", "emulated:cubesense")
    size = {"width": WIDTH, "height": HEIGHT}
    with (
        station(*targets, "--seed", SEED) as address,
        shown(chromium, address, viewport=size) as page,
    ):
        for name, image in drawn(page):
            stored = Image.open(IMAGES / name)
            told = f"{name} is old: run python -m docs.make_ground"
            assert abs(stored.height - image.height) <= 8, told
            now, before = (
                blocks(one.crop((0, 0, image.width, stored.height))) for one in (image, stored)
            )
            rows = min(len(now), len(before))
            assert np.abs(now[:rows] - before[:rows]).mean() < TOLERANCE, told
