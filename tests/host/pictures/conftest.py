from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cubestack.host.pictures.labels import Box
from cubestack.host.pictures.sheet import Colour


class Text(str):
    """A drawn text, with the box of its ink."""

    box: Box


def opened(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image)


def drawn(image: object, colour: Colour, rows: int | None = None) -> NDArray[np.float64]:
    """Columns and rows (n, 2) of pixels in a colour, in all rows or the first ones."""
    y, x = np.nonzero(np.all(np.asarray(image)[:rows] == colour, axis=2))
    return np.stack([x, y], axis=1).astype(float)


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[Text]:
    """All texts, in drawing order."""
    seen = list[Text]()
    whole = ImageDraw.ImageDraw.text

    def text(self, xy, text, fill=None, font=None):  # type: ignore[no-untyped-def]
        seen.append(Text(text))
        seen[-1].box = Box(*self.textbbox(xy, text, font))
        whole(self, xy, text, fill, font)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", text)
    return seen
