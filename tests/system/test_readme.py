import re
from pathlib import Path

import pytest
from PIL import Image

from docs.make_hero import PICTURE, caption_of, hero

from .conftest import ROOT

README = (ROOT / "README.md").read_text("utf-8")
NUMBER = r"\d+(?:\.\d+)?"


def test_readme_has_at_most_600_words() -> None:
    assert len(README.split()) <= 600


def test_caption_is_the_one_stored_in_the_picture() -> None:
    with Image.open(PICTURE) as picture:
        stored = picture.info["Description"]
    assert caption_of(README) == stored, "python -m docs.make_hero"


@pytest.mark.slow
def test_new_run_gives_the_same_caption(tmp_path: Path) -> None:
    _, caption = hero(tmp_path)
    stored = caption_of(README)
    assert re.sub(NUMBER, "N", caption) == re.sub(NUMBER, "N", stored)
    measured = [[float(one) for one in re.findall(NUMBER, text)] for text in (caption, stored)]
    assert measured[0][1:4] == pytest.approx(measured[1][1:4], abs=0.01)  # RA, Dec, roll
