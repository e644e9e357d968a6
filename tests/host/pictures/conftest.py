import pytest
from PIL import ImageDraw

from cubestack.host.pictures.labels import Box


class Text(str):
    """A drawn text, with the box of its ink."""

    box: Box


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
